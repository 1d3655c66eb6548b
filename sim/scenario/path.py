"""The path of an object as given: a screw motion, or a list of poses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from annotated_types import Gt, Lt
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import Pose, triple
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector
from fulcrum.synthesis.settings import Settings

# Least turn of a path and between poses [deg]: the tilt is an angle, so every part must turn.
_LEAST_TURN_DEG = 0.01
# Less than a turn: a measured orientation must determine the place on the path.
_MOST_DEG = 180.0
Angle = Annotated[float, Gt(0), Lt(_MOST_DEG)]


@dataclass(frozen=True)
class Pivot(Settings):
    """The path of the object: a screw motion about an axis fixed in the world."""

    start: Pose
    """Pose of the object at tilt 0."""

    point_W: Vector
    """A point on the axis [m]."""

    axis_W: Vector
    """Direction of the axis in the world; the tilt is positive by the right-hand rule."""

    angle_deg: Angle = 90.0
    """Tilt at the end [deg]."""

    pitch: float = 0.0
    """Advance along the axis [m/rad]."""

    travel: Vector = (0.0, 0.0, 0.0)
    """Additional translation at the end [m]; it grows in proportion to the tilt."""

    @property
    def label(self) -> str:
        """Name of the path in error messages."""
        return "path"

    def __post_init__(self) -> None:
        length = np.linalg.norm(self.axis_W)
        if not (np.isfinite(length) and length > 0.0):
            raise InvalidInputError("path.axis_W", self.axis_W, "a finite vector that is not zero")
        super().__post_init__()

    def scaled(self, factor: float) -> Pivot:
        """Return the path of an object larger by `factor`, about the same axis."""
        point = np.asarray(self.point_W)
        return replace(self, start=_scaled(self.start, factor, point))


@dataclass(frozen=True)
class Poses:
    """The path of the object: a smooth motion through given poses.

    The tilt is the sum of the angles from pose to pose, so each pose must be turned against the
    one before. Two poses are joined by a screw motion.

    Attributes:
        poses: Two or more poses of the object in the world; the first is at tilt 0.
    """

    poses: tuple[Pose, ...]

    def __post_init__(self) -> None:
        if len(self.poses) < 2:
            raise InvalidInputError("path.poses", f"{len(self.poses)} poses", "at least two")
        for i, turn in enumerate(np.degrees(np.diff(self.tilts)).tolist(), start=1):
            if not turn > _LEAST_TURN_DEG:
                given = f"a turn of {turn:.2g} deg from pose {i} to pose {i + 1}"
                valid = f"more than {_LEAST_TURN_DEG:g} deg: the tilt is what the object has turned"
                raise InvalidInputError("path.poses", given, valid)
        if not self.angle_deg < _MOST_DEG:
            given = f"turns of {self.angle_deg:.1f} deg in all"
            raise InvalidInputError("path.poses", given, f"less than {_MOST_DEG:g} deg")

    @property
    def start(self) -> Pose:
        """Pose of the object at tilt 0."""
        return self.poses[0]

    @property
    def angle_deg(self) -> float:
        """Tilt at the end [deg]."""
        return float(np.degrees(self.tilts[-1]))

    @cached_property
    def tilts(self) -> Array:
        """Tilts of the poses [rad], (k,)."""
        turns = self.rotations[1:] * self.rotations[:-1].inv()
        return np.concatenate([[0.0], np.cumsum(turns.magnitude())])

    @cached_property
    def rotations(self) -> Rotation:
        """Orientations of the poses, (k,)."""
        return Rotation.from_quat([p.quaternion for p in self.poses], scalar_first=True)

    @cached_property
    def positions(self) -> Array:
        """Positions of the poses [m], (k, 3)."""
        return np.array([pose.position for pose in self.poses])

    @cached_property
    def pivot_O(self) -> Array:
        """Point of the object that moves least [m], (3,), in the object frame.

        It is the c that minimises the sum over the poses of ``|R c + p - m|^2``, where m is the
        mean of the point's places. For a screw motion it lies on the axis.
        """
        R, p = self.rotations.as_matrix(), self.positions
        both = np.concatenate([R, np.broadcast_to(-np.eye(3), R.shape)], axis=2)
        return np.linalg.lstsq(both.reshape(-1, 6), -p.ravel(), rcond=1e-10)[0][:3]

    @cached_property
    def point_W(self) -> Vector:
        """Place of :attr:`pivot_O` in the world at the start [m]."""
        return triple(self.positions[0] + self.rotations[0].apply(self.pivot_O))

    def scaled(self, factor: float) -> Poses:
        """Return the path of an object larger by `factor`, about the same point."""
        point = np.asarray(self.point_W)
        return Poses(tuple(_scaled(pose, factor, point) for pose in self.poses))


def _scaled(pose: Pose, factor: float, point: Array) -> Pose:
    p_WO = np.asarray(pose.position)
    # A factor of 1 returns exactly the same numbers.
    return replace(pose, position=triple(p_WO + (factor - 1.0) * (p_WO - point)))
