"""Conversion of the official URDFs to MJCF: `python -m fulcrum.assets.from_urdf`."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

from fulcrum.assets import DESCRIPTIONS, ROBOTS, description_path
from fulcrum.assets.urdf import mjcf_of, text, without_branches

GRIPPER_JOINTS = ("left_gripper_base_joint", "right_gripper_base_joint")
HEADER = """\
<!-- {title}, from {path}
     of {wheel} {version} ({licence}).
     Made by `python -m fulcrum.assets.from_urdf`: do not edit.
     A joint's `user` number is its speed limit [rad/s]. -->
"""


@dataclass(frozen=True)
class Recipe:
    """Options for the conversion of an official URDF.

    Attributes:
        title: Name of the robot in the header.
        licence: Licence of the description.
        without: Joints that are left out with all their descendants.
        cuts: Heights [m] that cut a link's meshes into slices; each slice becomes one box.
        guards: Links whose shapes are in group 3, which viewers hide: they keep arms off the head.
    """

    title: str
    licence: str
    without: tuple[str, ...] = ()
    cuts: dict[str, tuple[float, ...]] = field(default_factory=dict)
    guards: tuple[str, ...] = ()


RECIPES = {
    "baxter": Recipe(
        title="Rethink Robotics Baxter without its electric grippers",
        licence="BSD",
        without=GRIPPER_JOINTS,
        cuts={"torso": (0.05, 0.21, 0.6, 0.71), "pedestal": (-0.642,)},
        guards=("collision_head_link_1", "collision_head_link_2"),
    ),
    "panda": Recipe(
        title="Franka Emika Panda without its hand",
        licence="Apache-2.0",
        without=("panda_hand_joint",),
    ),
    "ur5": Recipe(title="Universal Robots UR5", licence="BSD"),
}


def urdf_of(name: str) -> str:
    """Return the official URDF of a robot that ships, without the joints its recipe leaves out."""
    return without_branches(_description(name).read_text(), RECIPES[name].without)


def shipped_mjcf(name: str) -> str:
    """Return the text of the MJCF file of a robot that ships."""
    recipe, path = RECIPES[name], _description(name)
    mjcf = mjcf_of(urdf_of(name), path, recipe.cuts)
    for guard in recipe.guards:
        for geom in mjcf.findall(f".//body[@name='{guard}']/geom"):
            geom.set("group", "3")
    header = HEADER.format(
        title=recipe.title,
        path=ROBOTS[name],
        wheel=DESCRIPTIONS,
        version=version(DESCRIPTIONS),
        licence=recipe.licence,
    )
    return header + text(mjcf)


def _description(name: str) -> Path:
    description = ROBOTS[name]
    assert description is not None
    return description_path(description)


def main() -> None:
    """Write the MJCF files of all recipes."""
    for name in RECIPES:
        Path(__file__).with_name(f"{name}.xml").write_text(shipped_mjcf(name))


if __name__ == "__main__":
    main()
