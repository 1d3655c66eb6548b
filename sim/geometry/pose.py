"""Pose of a frame in its parent frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector
from fulcrum.synthesis.checks import vector

Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class Pose:
    """A frame's position [m] and orientation (quaternion wxyz) in its parent frame."""

    position: Vector = (0.0, 0.0, 0.0)
    quaternion: Quaternion = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        vector("pose.position", self.position, 3)
        vector("pose.quaternion", self.quaternion, 4)
        # Users of a quaternion normalise it; its squared length must be a finite number.
        if not 1e-3 < math.hypot(*self.quaternion) < 1e3:
            raise InvalidInputError("pose.quaternion", self.quaternion, "a quaternion of length 1")

    @property
    def rotation(self) -> Rotation:
        """Orientation in the parent frame."""
        return Rotation.from_quat(self.quaternion, scalar_first=True)

    def in_parent(self, p: Vector | Array) -> Array:
        """Return a point p of the frame [m], (3,), in the parent frame."""
        return np.asarray(self.position) + self.rotation.apply(p)

    def in_frame(self, p: Vector | Array) -> Array:
        """Return a point p of the parent frame [m], (3,), in the frame."""
        return self.rotation.inv().apply(p - np.asarray(self.position))


def triple(values: Array) -> Vector:
    """Return the numbers of an array, (3,), as a tuple."""
    x, y, z = values.tolist()
    return (x, y, z)


def wxyz(rotation: Rotation) -> Quaternion:
    """Return the quaternion (w, x, y, z) of a rotation."""
    w, x, y, z = rotation.as_quat(scalar_first=True).tolist()
    return (w, x, y, z)
