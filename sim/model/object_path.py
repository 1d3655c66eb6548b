"""The object's path as a function of the tilt, from a screw or poses; minimum-jerk timing."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from fulcrum.sim.geometry import quaternion
from fulcrum.sim.scenario import Pivot, Poses, Scenario
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array

# Step of the samples of a path through poses, for tilts of measured orientations and for checks
# of supports [rad].
_STEP = np.radians(0.5)
# Largest displacement of a support; its forces are those of sticking friction [m].
_STAYS = 1e-4
# Newton steps from the nearest sample to the nearest point of the path; each squares the error.
_REFINEMENTS = 4
# Least angle between the orientations of two places on the path, as a share of the tilt between
# them; below it a measured orientation does not determine the place.
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
        """Return orientation, (3, 3), and position [m], (3,), of the object at a tilt [rad]."""

    @abstractmethod
    def derivatives(self, tilt: float, p_O: Array) -> tuple[Array, Array]:
        """Return the derivatives of a point's place by tilt [m/rad, m/rad^2], (3,) each.

        Args:
            tilt: Tilt [rad].
            p_O: Point in the object frame [m], (3,).
        """

    @abstractmethod
    def axis(self, tilt: Array | float) -> Array:
        """Return the angular velocity per tilt rate, (..., 3), in the world, at tilts, (...)."""

    @abstractmethod
    def axis_slope(self, tilt: float) -> Array:
        """Return the derivative of :meth:`axis` by the tilt [1/rad], (3,)."""

    @abstractmethod
    def tilt(self, quat_WO: Array) -> Array:
        """Return the tilts [rad] of measured orientations, (..., 4) wxyz."""

    @abstractmethod
    def carry(
        self, before: float, after: float, p_WO: Array, quat_WO: Array
    ) -> tuple[Array, Array]:
        """Return a pose near the path at a tilt [rad], moved as the path moves to another tilt.

        Args:
            before: Tilt of the given pose [rad].
            after: Tilt of the returned pose [rad].
            p_WO: Position of the object [m], (3,).
            quat_WO: Orientation of the object, (4,), wxyz.
        """


def object_path(path: Pivot | Poses) -> ObjectPath:
    """Return the path of a scenario as a function of the tilt.

    Raises:
        InvalidInputError: Measured orientations do not determine the place on the path.
    """
    return ScrewPath(path) if isinstance(path, Pivot) else PosesPath(path)


class ScrewPath(ObjectPath):
    r"""Poses of the object along :math:`X_{WO}(\theta) = e^{[S]\theta} X_{WO}(0)`.

    S is the screw with the path's axis, point and pitch; the tilt :math:`\theta` is its angle. The
    travel is added in proportion to the tilt; it lifts the object off while it turns.

    Attributes:
        direction: Unit vector along the axis in the world, (3,).
        point: A point on the axis in the world [m], (3,).
        advance: Translation per tilt, from pitch and travel [m/rad], (3,).
        end: Tilt at the end [rad].
    """

    def __init__(self, pivot: Pivot) -> None:
        self.direction = np.asarray(pivot.axis_W, float) / float(np.linalg.norm(pivot.axis_W))
        self.end = float(np.radians(pivot.angle_deg))
        self.point = np.asarray(pivot.point_W, float)
        # Additional translation per tilt [m/rad].
        self.advance = pivot.pitch * self.direction + np.asarray(pivot.travel, float) / self.end
        self._R_WO = pivot.start.rotation
        # With q_0 the start, q times the inverse of q_0 has the real part cos(tilt / 2), and along
        # the axis the part sin(tilt / 2). Both are linear in q, with these rows.
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
        """See :meth:`ObjectPath.axis`; it is constant."""
        if isinstance(tilt, float):  # called every tick; many times faster
            return self.direction
        return np.broadcast_to(self.direction, (*np.shape(tilt), 3))

    def axis_slope(self, tilt: float) -> Array:
        """See :meth:`ObjectPath.axis_slope`; it is zero."""
        return _NO_SLOPE

    def tilt(self, quat_WO: Array) -> Array:
        """Return the twist about the axis [rad] of measured orientations, (..., 4) wxyz.

        The twist is the part of the rotation from the start that is about the axis, in
        [-pi, pi). The rest, the swing, does not count as tilt.
        """
        # Sums instead of a matrix product, whose rounding depends on the number of rows.
        cosine, sine = ((quat_WO * row).sum(axis=-1) for row in self._half_tilt)
        return np.mod(2.0 * np.arctan2(sine, cosine) + np.pi, 2.0 * np.pi) - np.pi

    def carry(
        self, before: float, after: float, p_WO: Array, quat_WO: Array
    ) -> tuple[Array, Array]:
        """See :meth:`ObjectPath.carry`."""
        turn = quaternion.about(self.direction, after - before)
        # The travel moves the axis along with the object.
        point = self.point + before * self.advance
        arm = quaternion.rotated(turn, p_WO - point)
        return self.point + after * self.advance + arm, quaternion.product(turn, quat_WO)


class PosesPath(ObjectPath):
    """A smooth path through poses.

    The orientation follows a rotation spline with continuous angular acceleration. The point of
    the object that moves least (:attr:`Poses.pivot_O`) follows a cubic spline. So poses about a
    fixed point give a motion about that point, and poses on a screw give that screw. Beyond its
    ends the path continues as a screw.
    """

    def __init__(self, poses: Poses) -> None:
        """Fit the path to the poses.

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
        # A fine table, accurate to 1e-8 rad and m and ten times as fast; signs are continuous.
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
        """Return orientation, angular velocity and acceleration per tilt, in the world."""
        inside = min(max(tilt, 0.0), self.end)
        R_WO = self._turns(inside).as_matrix()
        omega = R_WO @ self._turns(inside, 1)
        if inside == tilt:
            return R_WO, omega, R_WO @ self._turns(inside, 2)
        beyond = Rotation.from_rotvec((tilt - inside) * omega)
        return beyond.as_matrix() @ R_WO, omega, np.zeros(3)

    def _place(self, tilt: float) -> tuple[Array, Array, Array]:
        """Return the place of the pivot point in the world, and its derivatives by tilt."""
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
        """Return the tilts [rad] on the path nearest to measured orientations, (..., 4) wxyz.

        Beyond the ends the tilt is the turn about the axis at that end.
        """
        q = np.reshape(quat_WO, (-1, 4))
        measured = Rotation.from_quat(q, scalar_first=True)
        # Sums instead of a matrix product, whose rounding depends on the number of rows.
        near = np.abs((q[:, None] * self._quats).sum(axis=-1)).argmax(axis=1)
        tilt = self._grid[near]
        for _ in range(_REFINEMENTS):
            inside = np.clip(tilt, 0.0, self.end)
            rate = self._turns(inside, 1)
            there = self._turns(inside) * Rotation.from_rotvec((tilt - inside)[:, None] * rate)
            # The remaining turn, in the object's axes at that tilt, as is the rate.
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
    """Refuse a list of poses that moves a support; its forces are those of sticking friction.

    Raises:
        InvalidInputError: A support moves by more than 0.1 mm from its start.
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
    """Return the minimum-jerk profile from 0 to 1, and its derivatives, at x clipped to [0, 1].

    Source: Flash and Hogan 1985, the polynomial 10 x^3 - 15 x^4 + 6 x^5.
    """
    x = np.clip(x, 0.0, 1.0)
    rest = x * (1.0 - x)
    acceleration = 60.0 * rest * (1.0 - 2.0 * x)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * rest * rest, acceleration
