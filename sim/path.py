"""The object's path: a screw motion about a fixed axis, and its timing."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from sim.scenario import Pivot, Pose
from sim.settings import Timing
from synthesis import InvalidInputError
from synthesis.contact import Array


def rotation(pose: Pose) -> Rotation:
    """Orientation of a pose (whose quaternion is wxyz)."""
    return Rotation.from_quat(pose.quaternion, scalar_first=True)


class ScrewPath:
    r"""Poses of the object along :math:`X_{WO}(\theta) = e^{[S]\theta} X_{WO}(0)`.

    S is the screw with the path's axis, point and pitch; the tilt :math:`\theta` is its angle.
    """

    def __init__(self, pivot: Pivot) -> None:
        length = float(np.linalg.norm(pivot.axis_W))
        if not (np.isfinite(length) and length > 0.0):
            raise InvalidInputError("path.axis_W", pivot.axis_W, "a finite vector that is not zero")
        for name, value in (
            ("point_W", pivot.point_W),
            ("pitch", pivot.pitch),
            ("start.position", pivot.start.position),
            ("start.quaternion", pivot.start.quaternion),
        ):
            if not np.isfinite(value).all():
                raise InvalidInputError(f"path.{name}", value, "finite numbers")
        if not 0.0 < pivot.angle_deg < 180.0:
            raise InvalidInputError("path.angle_deg", pivot.angle_deg, "in (0, 180) deg")
        self.axis = np.asarray(pivot.axis_W, float) / length
        self.end = float(np.radians(pivot.angle_deg))
        self._point = np.asarray(pivot.point_W, float)
        self._pitch = pivot.pitch
        self._R_WO = rotation(pivot.start)
        self._p_WO = np.asarray(pivot.start.position, float)

    def pose(self, tilt: float) -> tuple[Array, Array]:
        """Orientation, (3, 3), and position [m], (3,), of the object at a tilt [rad]."""
        turn = Rotation.from_rotvec(tilt * self.axis)
        p_WO = self._point + turn.apply(self._p_WO - self._point) + self._pitch * tilt * self.axis
        return (turn * self._R_WO).as_matrix(), p_WO

    def tilt(self, quaternion: Array) -> Array:
        """Tilt [rad] of measured orientations, (..., 4) wxyz: their twist about the axis.

        The twist is the part of the rotation from the start that is about the axis, in
        [-pi, pi); what is left, the swing, does not count as tilt.
        """
        flat = np.reshape(quaternion, (-1, 4))
        turn = (Rotation.from_quat(flat, scalar_first=True) * self._R_WO.inv()).as_quat(
            scalar_first=True
        )
        twist = 2.0 * np.arctan2(turn[:, 1:] @ self.axis, turn[:, 0])
        twist = np.mod(twist + np.pi, 2.0 * np.pi) - np.pi
        return twist.reshape(np.shape(quaternion)[:-1])


def minimum_jerk(x: Array | float) -> tuple[Array, Array]:
    """Position and velocity of the minimum-jerk profile from 0 to 1 over x in [0, 1], clipped.

    Source: Flash and Hogan 1985, the polynomial 10 x^3 - 15 x^4 + 6 x^5.
    """
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x**2 * (1.0 - x) ** 2


class Schedule:
    """When the phases are, and which tilt they ask for."""

    PHASES = ("grip", "tilt", "hold")

    def __init__(self, timing: Timing, end: float) -> None:
        self._timing = timing
        self._end = end

    @property
    def settled_s(self) -> float:
        """When grip is built up, and contacts are held to account [s]."""
        return self._timing.grip_s

    def tilt(self, t: Array | float) -> tuple[Array, Array]:
        """Reference tilt [rad] and its rate [rad/s] at times t [s]."""
        s, rate = minimum_jerk((t - self._timing.grip_s) / self._timing.tilt_s)
        return self._end * s, self._end * rate / self._timing.tilt_s

    def times(self, tilts: Array) -> Array:
        """When the reference passes tilts [rad] that rise from 0 to the end [s]."""
        t = np.linspace(self._timing.grip_s, self._timing.grip_s + self._timing.tilt_s, 10_001)
        return np.interp(tilts, self.tilt(t)[0], t)

    def grip(self, t: Array | float) -> Array:
        """Share of the synthesised forces that is applied at times t [s], from 0 to 1."""
        return minimum_jerk(t / self._timing.grip_s)[0]

    def phase(self, t: float) -> str:
        """Name of the phase at time t [s]."""
        ends = np.cumsum([self._timing.grip_s, self._timing.tilt_s])
        return self.PHASES[int(np.searchsorted(ends, t, side="right"))]
