"""MJCF models that ship with fulcrum, and the official robot descriptions they come from.

This package imports neither a simulator nor a mesh reader, so that every other package may ask it
for a path.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco

DESCRIPTIONS = "example-robot-data"
"""The wheel that holds the official descriptions; pure data, nothing in it can be imported."""

ROBOTS: dict[str, str | None] = {
    "baxter": "baxter_description/urdf/baxter.urdf",
    "gripper": None,
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
}
"""The robots that ship, each with the description whose meshes recordings show."""
HANDS = ("finger_tip", "palm_pad")
"""The hands that ship."""

_HERE = Path(__file__).parent


def asset_path(name: str) -> Path:
    """Path of a shipped MJCF file.

    Args:
        name: File name, such as `"baxter.xml"`.

    Raises:
        FileNotFoundError: If there is no such file; the message lists the valid names.
    """
    valid = sorted(path.name for path in _HERE.glob("*.xml"))
    if name not in valid:
        raise FileNotFoundError(f"asset: got {name!r}; valid is one of {', '.join(valid)}.")
    return _HERE / name


def description_path(relative: str) -> Path:
    """Path of a file among the official descriptions of the installed wheel.

    Args:
        relative: Path below its folder `robots`, such as `"baxter_description/urdf/baxter.urdf"`.

    Raises:
        FileNotFoundError: If the wheel is not installed or has no such file.
    """
    try:
        wheel = distribution(DESCRIPTIONS)
    except PackageNotFoundError as error:
        raise FileNotFoundError(
            f"description {relative!r}: the wheel {DESCRIPTIONS} is not installed; "
            f"valid is an environment after `pip install {DESCRIPTIONS}`."
        ) from error
    robots = Path(str(wheel.locate_file("cmeel.prefix/share/example-robot-data/robots")))
    path = robots / relative
    if not path.is_file():
        raise FileNotFoundError(
            f"description: got {relative!r}; valid is a file below {robots} "
            f"({DESCRIPTIONS} {wheel.version})."
        )
    return path


def velocity_limits(model: mujoco.MjModel) -> dict[str, float]:
    """Speed limits [rad/s or m/s] by joint name.

    MJCF knows no speed limit of a joint; the robots here carry it as the first number of the
    joint's `user` data, which stays with the joint when the robot is attached to a scene.

    Raises:
        ValueError: If the model's joints carry no user data.
    """
    if model.nuser_jnt == 0:
        raise ValueError("velocity_limits: got joints without user data; valid is `user=` [rad/s].")
    limits = ((model.joint(i).name, float(model.jnt_user[i, 0])) for i in range(model.njnt))
    return {name: limit for name, limit in limits if limit > 0.0}
