"""Where a frame is in its parent frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.checks import vector
from synthesis import InvalidInputError

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class Pose:
    """A frame's position [m] and orientation (quaternion wxyz) in its parent frame."""

    position: Vector = (0.0, 0.0, 0.0)
    quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        vector("pose.position", self.position, 3)
        vector("pose.quaternion", self.quaternion, 4)
        # They are normalised where they are used, if their squares are numbers.
        if not 1e-3 < math.hypot(*self.quaternion) < 1e3:
            raise InvalidInputError("pose.quaternion", self.quaternion, "a quaternion of length 1")
