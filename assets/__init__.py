"""MJCF models that ship with fulcrum, and the official robot descriptions that they are made from.

This package imports neither a simulator nor a mesh reader, so that every package can import it.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco

DESCRIPTIONS = "example-robot-data"
"""The wheel with the official descriptions: pure data, without modules."""

ROBOTS: dict[str, str | None] = {
    "baxter": "baxter_description/urdf/baxter.urdf",
    "gripper": None,
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
}
"""The robots that ship, and the description with the meshes that recordings show."""
HANDS = ("finger_tip", "palm_pad")
"""The hands that ship."""

_HERE = Path(__file__).parent


def asset_path(name: str) -> Path:
    """Return the path of a shipped MJCF file, such as `"baxter.xml"`.

    Raises:
        FileNotFoundError: There is no such file; the message lists the valid names.
    """
    valid = sorted(path.name for path in _HERE.glob("*.xml"))
    if name not in valid:
        raise FileNotFoundError(f"asset: got {name!r}; valid is one of {', '.join(valid)}.")
    return _HERE / name


def description_path(relative: str) -> Path:
    """Return the path of a file of the official descriptions.

    Args:
        relative: Path below the folder `robots`, such as `"baxter_description/urdf/baxter.urdf"`.

    Raises:
        FileNotFoundError: The wheel is not installed or has no such file.
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
    """Return the speed limits [rad/s or m/s] by joint name.

    MJCF has no speed limit of a joint. In the robots here it is the first number of the joint's
    `user` data, which is kept when the robot is attached to a scene.

    Raises:
        ValueError: The model's joints have no user data.
    """
    if model.nuser_jnt == 0:
        raise ValueError("velocity_limits: got joints without user data; valid is `user=` [rad/s].")
    limits = ((model.joint(i).name, float(model.jnt_user[i, 0])) for i in range(model.njnt))
    return {name: limit for name, limit in limits if limit > 0.0}
