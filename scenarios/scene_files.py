"""Writes the files made from scenarios: scenes for MuJoCo's own viewer, and the schema."""

from __future__ import annotations

import json
from pathlib import Path

from fulcrum import assets
from fulcrum.scenarios.reading.file import SCHEMA, schema
from fulcrum.scenarios.reading.library import scenarios
from fulcrum.sim.model import compose
from fulcrum.sim.motion import plan_joints
from fulcrum.sim.plant import MujocoPlant
from fulcrum.sim.scenario import Scenario


def scene_xml(scenario: Scenario) -> str:
    """Return the scene's MJCF, with the start as its keyframe ``start``."""
    plant = MujocoPlant(scenario)
    plant.reset(plan_joints(scenario).start)
    spec = compose(scenario)
    spec.add_key(name="start", qpos=plant.physics.data.qpos)
    header = f"<!-- {scenario.summary}. Made by `make assets`: do not edit. -->\n"
    return header + str(spec.to_xml())


def schema_json() -> str:
    """Return the JSON Schema of scenario files, as it is published."""
    return json.dumps(schema(), indent=2) + "\n"


def main() -> None:
    """Rewrite the files."""
    SCHEMA.write_text(schema_json())
    for scenario in scenarios().values():
        (Path(assets.__file__).parent / f"{scenario.name}.xml").write_text(scene_xml(scenario))


if __name__ == "__main__":
    main()
