"""The scenario file as models: the robots, the path of the object, and the phases along it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from annotated_types import Len
from pydantic import Discriminator, Field, Tag

from fulcrum.scenarios.schema.derive import FromTable, same
from fulcrum.scenarios.schema.kinds import PREFIX, Corner, Direction, FileTable, Placed, Vector3
from fulcrum.sim.scenario import REACH, TILT, Angle, Duration, Gap, Phase, Pivot, Robot, Scenario
from fulcrum.synthesis.settings import NotNegative, Positive, Text

_APPROACH, _TOUCH, _GRIP = REACH


class RobotTable(Placed):
    """A robot, its place and its start posture. Joints without a start position are locked."""

    model: Text
    """Name of a robot that ships, or a URDF or MJCF file relative to this file."""

    prefix: Annotated[str, Field(pattern=PREFIX)] = same(Robot, "prefix")

    posture_deg: dict[str, float] = {}
    """Start angles by joint, without the prefix [deg]; inverse kinematics starts from them."""

    posture_rad: dict[str, float] = {}
    """Start angles [rad]; every joint is in only one of these tables."""

    posture_m: dict[str, float] = {}
    """Start positions of sliding joints [m]."""

    still: list[str] = same(Robot, "still")

    torque_limit_nm: dict[str, Positive] = {}
    """Torque limits by joint [N m], where they are lower than those of the model."""

    force_limit_n: dict[str, Positive] = {}
    """Force limits of sliding joints [N]."""

    speed_limit_rad_s: dict[str, Positive] = {}
    """Speed limits by joint [rad/s]."""

    speed_limit_m_s: dict[str, Positive] = {}
    """Speed limits of sliding joints [m/s]."""

    start_deviation: NotNegative = same(Robot, "start_deviation")


class TurnTable(FileTable):
    """A turn about an edge of the box, or about an axis."""

    angle_deg: Angle = same(Pivot, "angle_deg")

    edge: Annotated[list[Corner], Len(2, 2)] | None = None
    """Two corners of the box, which turns about the line from the first to the second by the
    right-hand rule."""

    point_m: Vector3 | None = None
    """A point on the axis, in the world [m], instead of an edge."""

    axis: Direction | None = None
    """Direction of the axis, in world axes, with point_m."""


class TiltTable(TurnTable):
    """A tilt about an edge of the box, or about an axis."""

    kind: Literal["tilt"] = "tilt"
    """tilt, screw or poses."""


class ScrewTable(TurnTable):
    """A tilt that also advances."""

    kind: Literal["screw"]
    """tilt, screw or poses."""

    pitch_m_per_rad: float = same(Pivot, "pitch")

    travel_m: Vector3 = same(Pivot, "travel")


class PoseTable(Placed):
    """A pose on the path of the object."""

    position_m: Vector3
    """Position in the world [m]."""


class PosesTable(FileTable):
    """A smooth path through poses, from where the object is at the start."""

    kind: Literal["poses"]
    """tilt, screw or poses."""

    poses: Annotated[list[PoseTable], Len(1)]
    """Poses after the start, each with another orientation than the one before."""


def _kind(path: Any) -> Any:
    return path.get("kind", "tilt") if isinstance(path, dict) else "tilt"


AnyPath = Annotated[
    Annotated[TiltTable, Tag("tilt")]
    | Annotated[ScrewTable, Tag("screw")]
    | Annotated[PosesTable, Tag("poses")],
    Discriminator(_kind),
]


After = Literal["leave", "hold"]


class ManoeuvreTable(FileTable):
    """Timing of the phases: approach, touch, grip, tilt, and what follows."""

    approach_s: Duration = _APPROACH.duration_s
    """Duration of the hands' approach [s]."""

    touch_s: Duration = _TOUCH.duration_s
    """Duration of the last 5 mm before contact [s]: short ones make heavy links hit hard."""

    grip_s: Duration = _GRIP.duration_s
    """Duration in which the grip force builds up [s]."""

    tilt_s: Duration = TILT[0].duration_s
    """Duration of the tilt [s]."""

    after: After = "hold"
    """What follows the tilt: hold keeps holding the object, leave releases it and withdraws
    the hands."""

    standoff_m: Gap = same(Scenario, "standoff")

    phases: list[FromTable[Phase]] | None = None
    """All phases one by one, instead of the durations and after."""
