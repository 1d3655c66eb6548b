"""A robot of a scenario: its model, its place, its start posture and its limits."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fulcrum.sim.geometry.pose import Pose
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import not_negative, positive


@dataclass(frozen=True)
class Robot:
    """A robot, its place and its start posture; joints go by their names in the model.

    Attributes:
        model: Name of one that ships (see ``assets.ROBOTS``), or path of a URDF or MJCF file;
            ``assets/README.md`` says what is taken from it.
        posture: Start angle [rad or m] of every joint that is driven, from which inverse
            kinematics seeks; the other joints are locked at 0.
        prefix: Stands before the names of the robot's bodies, joints and geoms in the scene, so
            that two of a kind can stand in it.
        still: Joints that move along the path only if the others cannot do it alone: the fingers
            of a gripper, whose wrist carries them.
        base: Pose of the model's root in the world.
        start_deviation: Standard deviation of the start posture from the planned one [rad or m],
            drawn by the run's seed.
        torque_limits: Torques or forces [N m or N] that are asked of joints at most; they lower
            what the model says, or supply what it lacks.
        speed_limits: The same for speeds [rad/s or m/s].
    """

    model: str
    posture: dict[str, float]
    prefix: str = ""
    still: tuple[str, ...] = ()
    base: Pose = Pose()
    start_deviation: float = 1e-4
    torque_limits: dict[str, float] = field(default_factory=dict)
    speed_limits: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for joint, angle in self.posture.items():
            if not math.isfinite(angle):
                raise InvalidInputError(f"{self.label}.posture.{joint}", angle, "a finite number")
        for joint in self.still:
            if joint not in self.posture:
                valid = f"one of {', '.join(self.posture)}"
                raise InvalidInputError(f"{self.label}.still", joint, valid)
        not_negative(f"{self.label}.start_deviation", self.start_deviation)
        for name in ("torque_limits", "speed_limits"):
            for joint, limit in getattr(self, name).items():
                positive(f"{self.label}.{name}.{joint}", limit)

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"{self.prefix}robot"
