"""Writes every scenario's scene as an MJCF file that MuJoCo's own viewer opens."""

from __future__ import annotations

from pathlib import Path

import assets
from scenarios import scenarios
from sim.ik import plan_joints
from sim.plant import Plant
from sim.scenario import Scenario
from sim.scene import compose


def scene_xml(scenario: Scenario) -> str:
    """The scene's MJCF, with the start as its keyframe ``start``."""
    plant = Plant(scenario)
    plant.reset(plan_joints(scenario).start)
    spec = compose(scenario)
    spec.add_key(name="start", qpos=plant.physics.data.qpos)
    header = f"<!-- {scenario.summary}. Made by `make assets`: do not edit. -->\n"
    return header + str(spec.to_xml())


def main() -> None:
    """Rewrites the files."""
    for scenario in scenarios().values():
        (Path(assets.__file__).parent / f"{scenario.name}.xml").write_text(scene_xml(scenario))


if __name__ == "__main__":
    main()
