"""A robot of a scenario: model, base, start posture and limits."""

from __future__ import annotations

from dataclasses import dataclass, field

from fulcrum.sim.geometry import Pose
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.settings import NotNegative, Positive, Settings


@dataclass(frozen=True)
class Robot(Settings):
    """A robot, its base and its start posture; joints have their names in the model."""

    model: str
    """Name of a shipped robot (see ``assets.ROBOTS``), or path of a URDF or MJCF file;
    ``assets/README.md`` says what is read from it."""

    posture: dict[str, float]
    """Start angle [rad or m] of every driven joint, where inverse kinematics begins; the other
    joints are locked at 0."""

    prefix: str = ""
    """Prefix of the names of its bodies and joints, different for each robot of a scene."""

    still: tuple[str, ...] = ()
    """Joints that move along the path only if the others cannot follow it alone, such as the
    fingers of a gripper."""

    base: Pose = Pose()
    """Pose of the model's root in the world."""

    start_deviation: NotNegative = 1e-4
    """Standard deviation of the real start posture from the planned one [rad or m]."""

    torque_limits: dict[str, Positive] = field(default_factory=dict)
    """Largest commanded torques or forces of joints [N m or N]. They lower the model's limits, or
    replace missing ones."""

    speed_limits: dict[str, Positive] = field(default_factory=dict)
    """Largest speeds of joints [rad/s or m/s]. They lower the model's limits, or replace missing
    ones."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for joint in self.still:
            if joint not in self.posture:
                valid = f"one of {', '.join(self.posture)}"
                raise InvalidInputError(f"{self.label}.still", joint, valid)

    @property
    def label(self) -> str:
        """Name of the robot in messages."""
        return f"{self.prefix}robot"
