"""The object's path: a screw motion about a fixed axis, and its timing."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from sim.scenario import Pivot, Pose
from synthesis import InvalidInputError
from synthesis.contact import Array


def rotation(pose: Pose) -> Rotation:
    """Orientation of a pose (whose quaternion is wxyz)."""
    return Rotation.from_quat(pose.quaternion, scalar_first=True)


class ScrewPath:
    r"""Poses of the object along :math:`X_{WO}(\theta) = e^{[S]\theta} X_{WO}(0)`.

    S is the screw with the path's axis, point and pitch; the tilt :math:`\theta` is its angle. A
    travel, which lifts the object off while it turns, is added in proportion to the tilt.

    Attributes:
        axis: Direction of the axis in the world, (3,), of length 1.
        point: A point on it [m], (3,).
        advance: Translation that goes with the turn [m/rad], (3,).
        end: Tilt at the end [rad].
    """

    def __init__(self, pivot: Pivot) -> None:
        length = float(np.linalg.norm(pivot.axis_W))
        if not (np.isfinite(length) and length > 0.0):
            raise InvalidInputError("path.axis_W", pivot.axis_W, "a finite vector that is not zero")
        for name, value in (
            ("point_W", pivot.point_W),
            ("pitch", pivot.pitch),
            ("travel", pivot.travel),
        ):
            if not np.isfinite(value).all():
                raise InvalidInputError(f"path.{name}", value, "finite numbers")
        if not 0.0 < pivot.angle_deg < 180.0:
            raise InvalidInputError("path.angle_deg", pivot.angle_deg, "in (0, 180) deg")
        self.axis = np.asarray(pivot.axis_W, float) / length
        self.end = float(np.radians(pivot.angle_deg))
        self.point = np.asarray(pivot.point_W, float)
        # Translation per radian on top of the turn [m].
        self.advance = pivot.pitch * self.axis + np.asarray(pivot.travel, float) / self.end
        self._R_WO = rotation(pivot.start)
        # With q_0 the start, q times the inverse of q_0 has the real part cos(tilt / 2) and, along
        # the axis, the part sin(tilt / 2): both are linear in q, with these rows.
        q_0 = self._R_WO.as_quat(scalar_first=True)
        w, v = q_0[0], q_0[1:]
        sine = np.concatenate([[-v @ self.axis], w * self.axis + np.cross(self.axis, v)])
        self._half_tilt = q_0, sine
        self._p_WO = np.asarray(pivot.start.position, float)

    def pose(self, tilt: float) -> tuple[Array, Array]:
        """Orientation, (3, 3), and position [m], (3,), of the object at a tilt [rad]."""
        turn = Rotation.from_rotvec(tilt * self.axis)
        p_WO = self.point + turn.apply(self._p_WO - self.point) + tilt * self.advance
        return (turn * self._R_WO).as_matrix(), p_WO

    def derivatives(self, tilt: float, p_O: Array) -> tuple[Array, Array]:
        """First and second derivatives by tilt [m/rad, m/rad^2], (3,) each, of a point's place.

        Args:
            tilt: [rad].
            p_O: The point in the object frame [m], (3,).
        """
        R_WO, p_WO = self.pose(tilt)
        arm = p_WO + R_WO @ p_O - tilt * self.advance - self.point
        turning = np.cross(self.axis, arm)
        return turning + self.advance, np.cross(self.axis, turning)

    def tilt(self, quaternion: Array) -> Array:
        """Tilt [rad] of measured orientations, (..., 4) wxyz: their twist about the axis.

        The twist is the part of the rotation from the start that is about the axis, in
        [-pi, pi); what is left, the swing, does not count as tilt.
        """
        # Sums, not a product of matrices, whose rounding depends on how many rows there are.
        cosine, sine = ((quaternion * row).sum(axis=-1) for row in self._half_tilt)
        return np.mod(2.0 * np.arctan2(sine, cosine) + np.pi, 2.0 * np.pi) - np.pi


def minimum_jerk(x: Array | float) -> tuple[Array, Array, Array]:
    """Position, velocity, acceleration of the minimum-jerk profile from 0 to 1 over x in [0, 1].

    x is clipped.

    Source: Flash and Hogan 1985, the polynomial 10 x^3 - 15 x^4 + 6 x^5.
    """
    x = np.clip(x, 0.0, 1.0)
    rest = x * (1.0 - x)
    acceleration = 60.0 * rest * (1.0 - 2.0 * x)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * rest * rest, acceleration
