"""The object's path as a function of the tilt, whatever it was given as; and its timing."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from fulcrum.sim.geometry import quaternion
from fulcrum.sim.scenario import Pivot, Poses, Scenario
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array

# A list of poses is looked at in these steps: where a measured orientation is, whether supports
# stay [rad].
_STEP = np.radians(0.5)
# How far a support may be from where it stood while forces count on friction that holds it [m].
_STAYS = 1e-4
# Steps from the nearest sample of the path to its nearest point; each squares what is left.
_REFINEMENTS = 4
# Two places on the path whose orientations differ by less than this share of the tilt between them
# cannot be told apart well.
_APART = 0.5
_NO_SLOPE = np.zeros(3)
_NO_SLOPE.setflags(write=False)


class ObjectPath(ABC):
    """Poses of the object over the tilt.

    Attributes:
        end: Tilt at the end [rad].
    """

    end: float

    @abstractmethod
    def pose(self, tilt: float) -> tuple[Array, Array]:
        """Orientation, (3, 3), and position [m], (3,), of the object at a tilt [rad]."""

    @abstractmethod
    def derivatives(self, tilt: float, p_O: Array) -> tuple[Array, Array]:
        """First and second derivatives by tilt [m/rad, m/rad^2], (3,) each, of a point's place.

        Args:
            tilt: [rad].
            p_O: The point in the object frame [m], (3,).
        """

    @abstractmethod
    def axis(self, tilt: Array | float) -> Array:
        """Angular velocity per rate of the tilt, in the world, (..., 3), at tilts, (...)."""

    @abstractmethod
    def axis_slope(self, tilt: float) -> Array:
        """Its derivative by the tilt [1/rad], (3,)."""

    @abstractmethod
    def tilt(self, quat_WO: Array) -> Array:
        """Tilt [rad] of measured orientations, (..., 4) wxyz."""

    @abstractmethod
    def carry(
        self, before: float, after: float, p_WO: Array, quat_WO: Array
    ) -> tuple[Array, Array]:
        """A pose near the path at one tilt, moved as the path moves to another [rad]."""


def object_path(path: Pivot | Poses) -> ObjectPath:
    """The path that is meant.

    Raises:
        InvalidInputError: It cannot be followed.
    """
    return ScrewPath(path) if isinstance(path, Pivot) else PosesPath(path)


class ScrewPath(ObjectPath):
    r"""Poses of the object along :math:`X_{WO}(\theta) = e^{[S]\theta} X_{WO}(0)`.

    S is the screw with the path's axis, point and pitch; the tilt :math:`\theta` is its angle. A
    travel, which lifts the object off while it turns, is added in proportion to the tilt.

    Attributes:
        direction: Direction of the axis in the world, (3,), of length 1.
        point: A point on it [m], (3,).
        advance: Translation that goes with the turn [m/rad], (3,).
        end: Tilt at the end [rad].
    """

    def __init__(self, pivot: Pivot) -> None:
        self.direction = np.asarray(pivot.axis_W, float) / float(np.linalg.norm(pivot.axis_W))
        self.end = float(np.radians(pivot.angle_deg))
        self.point = np.asarray(pivot.point_W, float)
        # Translation per radian on top of the turn [m].
        self.advance = pivot.pitch * self.direction + np.asarray(pivot.travel, float) / self.end
        self._R_WO = pivot.start.rotation
        # With q_0 the start, q times the inverse of q_0 has the real part cos(tilt / 2) and, along
        # the axis, the part sin(tilt / 2): both are linear in q, with these rows.
        q_0 = self._R_WO.as_quat(scalar_first=True)
        w, v = q_0[0], q_0[1:]
        sine = np.concatenate(
            [[-v @ self.direction], w * self.direction + np.cross(self.direction, v)]
        )
        self._half_tilt = q_0, sine
        self._p_WO = np.asarray(pivot.start.position, float)

    def pose(self, tilt: float) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.pose`."""
        turn = Rotation.from_rotvec(tilt * self.direction)
        p_WO = self.point + turn.apply(self._p_WO - self.point) + tilt * self.advance
        return (turn * self._R_WO).as_matrix(), p_WO

    def derivatives(self, tilt: float, p_O: Array) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.derivatives`."""
        R_WO, p_WO = self.pose(tilt)
        arm = p_WO + R_WO @ p_O - tilt * self.advance - self.point
        turning = np.cross(self.direction, arm)
        return turning + self.advance, np.cross(self.direction, turning)

    def axis(self, tilt: Array | float) -> Array:
        """See :meth:`ObjectPath.axis`: the same everywhere."""
        if isinstance(tilt, float):  # every tick, and many times cheaper
            return self.direction
        return np.broadcast_to(self.direction, (*np.shape(tilt), 3))

    def axis_slope(self, tilt: float) -> Array:
        """See :meth:`ObjectPath.axis_slope`: zero."""
        return _NO_SLOPE

    def tilt(self, quat_WO: Array) -> Array:
        """Tilt [rad] of measured orientations, (..., 4) wxyz: their twist about the axis.

        The twist is the part of the rotation from the start that is about the axis, in
        [-pi, pi); what is left, the swing, does not count as tilt.
        """
        # Sums, not a product of matrices, whose rounding depends on how many rows there are.
        cosine, sine = ((quat_WO * row).sum(axis=-1) for row in self._half_tilt)
        return np.mod(2.0 * np.arctan2(sine, cosine) + np.pi, 2.0 * np.pi) - np.pi

    def carry(
        self, before: float, after: float, p_WO: Array, quat_WO: Array
    ) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.carry`."""
        turn = quaternion.about(self.direction, after - before)
        # The axis travels with the object.
        point = self.point + before * self.advance
        arm = quaternion.rotated(turn, p_WO - point)
        return self.point + after * self.advance + arm, quaternion.product(turn, quat_WO)


class PosesPath(ObjectPath):
    """A smooth path through poses.

    The orientation follows a rotation spline, with continuous angular acceleration, and the point
    of the object that keeps its place best a cubic one: what turns about a fixed place in its list
    of poses does so in between, and poses on a screw give that screw. Beyond its ends the path goes
    on as a screw.
    """

    def __init__(self, poses: Poses) -> None:
        """Takes the poses.

        Raises:
            InvalidInputError: Different parts of the path have nearly the same orientation.
        """
        self.end = float(np.radians(poses.angle_deg))
        self._pivot_O = poses.pivot_O
        knots = poses.tilts
        places = poses.positions + poses.rotations.apply(self._pivot_O)
        kind = "not-a-knot" if len(knots) > 2 else "natural"
        self._turns, self._places = (
            RotationSpline(knots, poses.rotations),
            CubicSpline(knots, places, bc_type=kind),
        )
        self._grid = np.linspace(0.0, self.end, 2 + int(self.end / _STEP))
        self._quats = self._turns(self._grid).as_quat(scalar_first=True)
        self._check()
        # The same finely tabulated, to 1e-8 rad and m, in a tenth of the time; signs follow suit.
        signs = np.cumprod(np.sign([1.0, *(self._quats[1:] * self._quats[:-1]).sum(axis=1)]))
        rows = np.column_stack([signs[:, None] * self._quats, self._places(self._grid)])
        self._table = CubicSpline(self._grid, rows)

    def _check(self) -> None:
        cosines = np.abs(self._quats @ self._quats.T)
        angles = 2.0 * np.arccos(np.minimum(cosines, 1.0))
        apart = np.abs(np.subtract.outer(self._grid, self._grid))
        close = (angles < _APART * apart) & (apart > _STEP)
        if close.any():
            first, second = np.degrees(self._grid[np.argwhere(close)[0]])
            given = f"nearly the same orientation at tilts of {first:.1f} and {second:.1f} deg"
            raise InvalidInputError("path.poses", given, "turns that do not come back")

    def pose(self, tilt: float) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.pose`."""
        R_WO, _, _ = self._turn(tilt)
        place, _, _ = self._place(tilt)
        return R_WO, place - R_WO @ self._pivot_O

    def _turn(self, tilt: float) -> tuple[Array, Array, Array]:
        """Orientation and, in the world, its angular velocity and acceleration per tilt."""
        inside = min(max(tilt, 0.0), self.end)
        R_WO = self._turns(inside).as_matrix()
        omega = R_WO @ self._turns(inside, 1)
        if inside == tilt:
            return R_WO, omega, R_WO @ self._turns(inside, 2)
        beyond = Rotation.from_rotvec((tilt - inside) * omega)
        return beyond.as_matrix() @ R_WO, omega, np.zeros(3)

    def _place(self, tilt: float) -> tuple[Array, Array, Array]:
        """Place of the pivot's point in the world, and its derivatives."""
        inside = min(max(tilt, 0.0), self.end)
        place, slope = self._places(inside), self._places(inside, 1)
        if inside == tilt:
            return place, slope, self._places(inside, 2)
        return place + (tilt - inside) * slope, slope, np.zeros(3)

    def derivatives(self, tilt: float, p_O: Array) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.derivatives`."""
        R_WO, omega, alpha = self._turn(tilt)
        _, slope, curvature = self._place(tilt)
        arm = R_WO @ (p_O - self._pivot_O)
        turning = np.cross(omega, arm)
        return slope + turning, curvature + np.cross(alpha, arm) + np.cross(omega, turning)

    def axis(self, tilt: Array | float) -> Array:
        """See :meth:`ObjectPath.axis`."""
        inside = np.clip(tilt, 0.0, self.end)
        rates = self._turns(np.ravel(inside), 1)
        return self._turns(np.ravel(inside)).apply(rates).reshape(*np.shape(tilt), 3)

    def axis_slope(self, tilt: float) -> Array:
        """See :meth:`ObjectPath.axis_slope`."""
        return self._turn(tilt)[2]

    def tilt(self, quat_WO: Array) -> Array:
        """Tilt [rad] of measured orientations, (..., 4) wxyz: the nearest point of the path.

        Beyond the ends it goes on with the turn about the axis there.
        """
        q = np.reshape(quat_WO, (-1, 4))
        measured = Rotation.from_quat(q, scalar_first=True)
        # Sums, not a product of matrices, whose rounding depends on how many rows there are.
        near = np.abs((q[:, None] * self._quats).sum(axis=-1)).argmax(axis=1)
        tilt = self._grid[near]
        for _ in range(_REFINEMENTS):
            inside = np.clip(tilt, 0.0, self.end)
            rate = self._turns(inside, 1)
            there = self._turns(inside) * Rotation.from_rotvec((tilt - inside)[:, None] * rate)
            # What is missing, in the object's axes there, as the rate is.
            missing = (there.inv() * measured).as_rotvec()
            tilt = tilt + (missing * rate).sum(axis=1) / (rate * rate).sum(axis=1)
        return tilt.reshape(np.shape(quat_WO)[:-1])

    def carry(
        self, before: float, after: float, p_WO: Array, quat_WO: Array
    ) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.carry`."""
        start, stop = self._table((before, after))
        turn = quaternion.product(stop[:4], quaternion.inverse(start[:4]))
        turn = quaternion.normalized(turn)
        arm = quaternion.rotated(turn, p_WO - start[4:])
        return stop[4:] + arm, quaternion.product(turn, quat_WO)


def check_supports(scenario: Scenario) -> None:
    """Refuses a list of poses that moves a support, whose forces count on friction that holds it.

    Raises:
        InvalidInputError: One is more than 0.1 mm from where it stood at the start.
    """
    if not isinstance(scenario.path, Poses):
        return
    path = PosesPath(scenario.path)
    poses = [path.pose(tilt) for tilt in np.arange(0.0, path.end + _STEP / 2.0, _STEP)]
    for support in scenario.supports:
        places = np.array([p_WO + R_WO @ support.p_OP_O for R_WO, p_WO in poses])
        moved = np.linalg.norm(places - places[0], axis=1)
        worst = int(moved.argmax())
        if moved[worst] > _STAYS:
            given = f"{support.name} moved by {1e3 * moved[worst]:.2g} mm"
            given += f" at a tilt of {np.degrees(worst * _STEP):.1f} deg"
            valid = f"poses that keep every support in place within {1e3 * _STAYS:g} mm"
            raise InvalidInputError("path.poses", given, valid)


def minimum_jerk(x: Array | float) -> tuple[Array, Array, Array]:
    """Position, velocity, acceleration of the minimum-jerk profile from 0 to 1 over x in [0, 1].

    x is clipped.

    Source: Flash and Hogan 1985, the polynomial 10 x^3 - 15 x^4 + 6 x^5.
    """
    x = np.clip(x, 0.0, 1.0)
    rest = x * (1.0 - x)
    acceleration = 60.0 * rest * (1.0 - 2.0 * x)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * rest * rest, acceleration
