"""What the path of an object is given as: a screw motion, or poses that it passes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry.pose import Pose, triple
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector
from fulcrum.synthesis.checks import length

# The tilt is an angle: where the object does not turn, it would stand still [deg].
_LEAST_TURN_DEG = 0.01
# A measured orientation has to say where on the path the object is.
_MOST_DEG = 180.0


@dataclass(frozen=True)
class Pivot:
    """The path of the object: a screw motion about an axis fixed in the world.

    Attributes:
        start: Pose of the object at tilt 0.
        point_W: A point on the axis [m].
        axis_W: Direction of the axis; the tilt is positive by the right-hand rule.
        angle_deg: Tilt at the end [deg].
        pitch: Advance along the axis per radian [m].
        travel: Translation on top of the screw, in proportion to the tilt, at the end [m].
    """

    start: Pose
    point_W: Vector
    axis_W: Vector
    angle_deg: float = 90.0
    pitch: float = 0.0
    travel: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("point_W", "axis_W", "travel"):
            length(f"path.{name}", getattr(self, name), 3)

    def scaled(self, factor: float) -> Pivot:
        """That of an object which is so many times as large, about the same axis."""
        point = np.asarray(self.point_W)
        return replace(self, start=_scaled(self.start, factor, point))


@dataclass(frozen=True)
class Poses:
    """The path of the object: poses that it passes, smoothly in between.

    The tilt is the angle by which the object has turned, added up from pose to pose; so every pose
    is turned against the one before. Two poses are joined by a screw motion.

    Attributes:
        poses: At least two; the first is that at tilt 0.
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
        """The point of the object that keeps its place best [m], (3,), in the object frame.

        That of a screw motion is on its axis. It minimises the sum of squares of R c + p - m over
        c and m, where m is the mean of its places.
        """
        R, p = self.rotations.as_matrix(), self.positions
        both = np.concatenate([R, np.broadcast_to(-np.eye(3), R.shape)], axis=2)
        return np.linalg.lstsq(both.reshape(-1, 6), -p.ravel(), rcond=1e-10)[0][:3]

    @cached_property
    def point_W(self) -> Vector:
        """Where that point is at the start [m]."""
        return triple(self.positions[0] + self.rotations[0].apply(self.pivot_O))

    def scaled(self, factor: float) -> Poses:
        """That of an object which is so many times as large, about the same point."""
        point = np.asarray(self.point_W)
        return Poses(tuple(_scaled(pose, factor, point) for pose in self.poses))


def _scaled(pose: Pose, factor: float, point: Array) -> Pose:
    p_WO = np.asarray(pose.position)
    # Of a factor of 1 not even the last bit differs.
    return replace(pose, position=triple(p_WO + (factor - 1.0) * (p_WO - point)))
