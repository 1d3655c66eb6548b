"""A robot of a scenario: its model, its place, its start posture and its limits."""

from __future__ import annotations

from dataclasses import dataclass, field

from fulcrum.sim.geometry import Pose
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.settings import NotNegative, Positive, Settings


@dataclass(frozen=True)
class Robot(Settings):
    """A robot, its place and its start posture; joints go by their names in the model."""

    model: str
    """Name of one that ships (see ``assets.ROBOTS``), or path of a URDF or MJCF file;
    ``assets/README.md`` says what is taken from it."""

    posture: dict[str, float]
    """Start angle [rad or m] of every joint that is driven, from which inverse kinematics seeks;
    the other joints are locked at 0."""

    prefix: str = ""
    """What stands before the names of its bodies and joints; robots of a scene differ in it."""

    still: tuple[str, ...] = ()
    """Joints that move along the path only if the others cannot do it alone, such as the fingers
    of a gripper."""

    base: Pose = Pose()
    """Pose of the model's root in the world."""

    start_deviation: NotNegative = 1e-4
    """Standard deviation of the real start posture from the planned one [rad or m]."""

    torque_limits: dict[str, Positive] = field(default_factory=dict)
    """Largest torques or forces [N m or N] that are asked of joints; they lower what the model
    says, or supply what it lacks."""

    speed_limits: dict[str, Positive] = field(default_factory=dict)
    """The same for speeds [rad/s or m/s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for joint in self.still:
            if joint not in self.posture:
                valid = f"one of {', '.join(self.posture)}"
                raise InvalidInputError(f"{self.label}.still", joint, valid)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"{self.prefix}robot"
