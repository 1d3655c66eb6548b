r"""Forces and timing along a path: problem (17) at every grid point, with inertia.

The path coordinate s runs over a grid :math:`s_0 < \dots < s_N`. Its timing is :math:`b = \dot s^2`
at the grid points and :math:`a = \ddot s`, constant between them, so that
:math:`b_{k+1} - b_k = 2 a_k (s_{k+1} - s_k)` holds exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from fulcrum.synthesis import InvalidInputError, Joints, Problem, checks
from fulcrum.synthesis.arrays import Array, Indices
from fulcrum.synthesis.path.limits import Accelerations, Rates


class PathObjective(StrEnum):
    """The quantity to minimise along the path."""

    LEAST_TIME = "least-time"
    LEAST_EFFORT = "least-effort"
    FRICTION_MARGIN = "friction-margin"

    @property
    def needs_duration(self) -> bool:
        """Return whether the solution needs a largest duration to be finite and useful."""
        return self is not PathObjective.LEAST_TIME


@dataclass(frozen=True, eq=False)
class InertialTorques:
    r"""Joint torque that motion needs: :math:`\tau_a a + \tau_b b + \tau_c \sqrt b`.

    Along joint angles q(s) the robot's dynamics give :math:`\tau_a = M q'`,
    :math:`\tau_b = M q'' + C(q, q') q'` and, with viscous joint friction D, :math:`\tau_c = D q'`.

    Attributes:
        tau_a, tau_b, tau_c: Coefficients of a, b and the square root of b, (K, l).
    """

    tau_a: Array
    tau_b: Array
    tau_c: Array

    def __post_init__(self) -> None:
        for name in ("tau_a", "tau_b", "tau_c"):
            checks.array(f"inertial_torques.{name}", getattr(self, name), np.shape(self.tau_a))

    def at(self, points: Indices) -> InertialTorques:
        """Return the torques at some grid points, by index."""
        return InertialTorques(self.tau_a[points], self.tau_b[points], self.tau_c[points])

    def added_to(self, tau: Array, a: Array, b: Array) -> Array:
        """Return torques at rest, (K, l), plus those of a motion a, b [1/s^2], (K,)."""
        a, b = a[:, None], b[:, None]
        return tau + self.tau_a * a + self.tau_b * b + self.tau_c * np.sqrt(b)


@dataclass(frozen=True, eq=False)
class Load:
    r"""An object that is moved along the path: contacts, weight and inertia at every grid point.

    Attributes:
        problems: (17) at rest at each of the K grid points; their objectives are not used.
        w_a_O, w_b_O: Coefficients of the wrench :math:`w_a a + w_b b` that accelerates the object,
            in its frame [N, N·m], (K, 6).
        w_a_B, w_b_B: The same about the point B of each problem; derived.

    Raises:
        InvalidInputError: Shapes differ, or the problems differ in structure.
    """

    problems: tuple[Problem, ...]
    w_a_O: Array
    w_b_O: Array
    w_a_B: Array = field(init=False, repr=False)
    w_b_B: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        points = len(self.problems)
        if not points:
            raise InvalidInputError("load.problems", "none", "one for every grid point")
        for axis in "ab":
            w_O = getattr(self, f"w_{axis}_O")
            checks.array(f"load.w_{axis}_O", w_O, (points, 6))
            pairs = zip(self.problems, w_O, strict=True)
            object.__setattr__(self, f"w_{axis}_B", np.array([p.about_B(w) for p, w in pairs]))
        first = self.problems[0]
        for k, problem in enumerate(self.problems):
            same = problem.contacts == first.contacts
            if not same or _kind(problem.joints) != _kind(first.joints):
                valid = "the contacts, joints and kinds of limits of the first"
                raise InvalidInputError(f"load.problems[{k}]", "another structure", valid)

    @cached_property
    def unit(self) -> float:
        """Return the largest load of all grid points, or 1 without load [N or N·m]."""
        return max(problem.load for problem in self.problems) or 1.0

    @cached_property
    def G(self) -> Array:
        """Return the grasp maps about B, (K, m, 6, 6)."""
        return np.stack([problem.G for problem in self.problems])

    @cached_property
    def w_ext_B(self) -> Array:
        """Return the external wrench at rest about B [N, N·m], (K, 6)."""
        return np.stack([problem.w_ext_B for problem in self.problems])

    @cached_property
    def joints(self) -> tuple[Joints, ...]:
        """Return the joints at each grid point; empty without joints."""
        return tuple(p.joints for p in self.problems if p.joints is not None)

    @cached_property
    def tau_min(self) -> Array:
        """Return the lower torque limits [N·m or N], (K, l)."""
        return np.stack([joints.tau_min for joints in self.joints])

    @cached_property
    def tau_max(self) -> Array:
        """Return the upper torque limits [N·m or N], (K, l)."""
        return np.stack([joints.tau_max for joints in self.joints])


def _kind(joints: Joints | None) -> object:
    """Return the names of joints and which of their limits are finite."""
    if joints is None:
        return None
    limits = np.concatenate([joints.tau_min, joints.tau_max])
    return joints.names, np.isfinite(limits).tobytes()


@dataclass(frozen=True, eq=False)
class PathProblem:
    r"""The timing of a path and the forces along it, as one second-order cone program.

    .. math::

        \text{minimise}\quad   & \Phi(a, b, F, \tau) \\
        \text{subject to}\quad & G F + w_{ext} = w_a a + w_b b \\
                               & \tau = J^T F_C + \tau_g + \tau_a a + \tau_b b + \tau_c \sqrt b \\
                               & \text{(16), (7), (5), (6) of the paper} \\
                               & |x_r'| \sqrt b \le x_{r,max}, \quad
                                 \|x_q' a + x_q'' b\| \le x_{q,max} \\
                               & \textstyle\int ds / \sqrt b \le T

    at both ends of every interval of the grid, with that interval's a. Accelerations and forces
    jump at grid points. With a single grid point a = b = 0, and the problem is (17).

    Several loads represent an uncertain object: a, b and the normal forces of the hands are common
    to all loads; tangential forces and the environment's forces may differ.

    Objectives: the duration; the mean over the path of the sum of squared torque utilisations
    :math:`2\tau / (\tau_{max} - \tau_{min})`; the largest friction utilisation.

    Attributes:
        s: The K grid points, increasing.
        loads: One or several loads.
        inertial_torques: Torques that the robot's motion needs; None without joints.
        rates: Speed limits.
        accelerations: Acceleration limits.
        objective: Phi.
        duration: Largest duration T [s]; may be infinite.
        start_rate, end_rate: :math:`\dot s` at both ends [1/s].
        timing: Given b at the grid points [1/s^2], (K,), or None. If given, only forces are sought,
            and limits of rates, accelerations and duration do not apply.

    Raises:
        InvalidInputError: A field is not finite, has a wrong shape or contradicts another.
    """

    s: Array
    loads: tuple[Load, ...]
    inertial_torques: InertialTorques | None = None
    rates: Rates | None = None
    accelerations: Accelerations | None = None
    objective: PathObjective = PathObjective.LEAST_TIME
    duration: float = math.inf
    start_rate: float = 0.0
    end_rate: float = 0.0
    timing: Array | None = None

    def __post_init__(self) -> None:
        points = len(self.s)
        checks.array("s", self.s, (points,))
        if not points or (np.diff(self.s) <= 0.0).any():
            raise InvalidInputError("s", "numbers that do not increase", "an increasing grid")
        if not self.loads:
            raise InvalidInputError("loads", "none", "at least one")
        for i, load in enumerate(self.loads):
            if len(load.problems) != points:
                given = f"{len(load.problems)} problems"
                raise InvalidInputError(f"loads[{i}]", given, f"one for each of {points} points")
            self._check_alike(i, load.problems[0])
        self._check_torques(points)
        if self.rates is not None:
            checks.shape("rates.slopes", self.rates.slopes, (points, len(self.rates.names)))
        if self.accelerations is not None and len(self.accelerations.slopes) != points:
            given = f"{len(self.accelerations.slopes)} points"
            raise InvalidInputError("accelerations.slopes", given, f"{points} points")
        checks.not_negative("start_rate", self.start_rate)
        checks.not_negative("end_rate", self.end_rate)
        if not self.duration > 0.0:
            raise InvalidInputError("duration", self.duration, "a time > 0 s")
        if self.timing is not None:
            checks.array("timing", self.timing, (points,))
            if (self.timing[1:-1] <= 0.0).any() or (self.timing < 0.0).any():
                raise InvalidInputError("timing", "rests on the way", "positive between the ends")
            if self.objective is PathObjective.LEAST_TIME:
                raise InvalidInputError("objective", self.objective, "one of forces, with a timing")
        elif self.objective.needs_duration and points > 1 and not math.isfinite(self.duration):
            raise InvalidInputError("duration", self.duration, f"a finite time > 0 s, {self._asks}")

    @property
    def _asks(self) -> str:
        return f"as objective {self.objective} asks"

    def _check_alike(self, index: int, problem: Problem) -> None:
        """Check that a load has the hands and joints of the first load."""
        first = self.loads[0].problems[0]
        names = [[p.contacts[i].name for i in p.hands] for p in (problem, first)]
        joints = [() if p.joints is None else p.joints.names for p in (problem, first)]
        if names[0] != names[1] or joints[0] != joints[1]:
            valid = "the hands and joints of the first load"
            raise InvalidInputError(f"loads[{index}]", "other hands or joints", valid)
        margin = self.objective is PathObjective.FRICTION_MARGIN
        if margin and not problem.contact_set.rough.any():
            raise InvalidInputError("contacts", "no friction", f"friction, {self._asks}")

    def _check_torques(self, points: int) -> None:
        joints, torques = self.loads[0].problems[0].joints, self.inertial_torques
        effort = self.objective is PathObjective.LEAST_EFFORT
        if joints is None:
            if torques is not None:
                raise InvalidInputError("inertial_torques", "torques", "None without joints")
            if effort:
                raise InvalidInputError("joints", None, f"joints, {self._asks}")
            return
        if torques is None:
            raise InvalidInputError("inertial_torques", None, "torques, as there are joints")
        checks.shape("inertial_torques.tau_a", torques.tau_a, (points, len(joints.names)))
        usable = np.isfinite(joints.tau_min) & np.isfinite(joints.tau_max)
        usable &= joints.tau_min < joints.tau_max
        if effort and not usable.all():
            worst = joints.names[int(np.argmin(usable))]
            asks = f"finite with tau_min < tau_max, {self._asks}"
            raise InvalidInputError(f"limits of {worst}", "no finite range", asks)

    def at(self, points: Indices) -> PathProblem:
        """Return the same path on some of its grid points, by index."""
        torques, rates, limited = self.inertial_torques, self.rates, self.accelerations
        if rates is not None:
            rates = replace(rates, slopes=rates.slopes[points])
        if limited is not None:
            slopes, curvatures = limited.slopes[points], limited.curvatures[points]
            limited = replace(limited, slopes=slopes, curvatures=curvatures)
        return replace(
            self,
            s=self.s[points],
            loads=tuple(
                Load(tuple(e.problems[k] for k in points), e.w_a_O[points], e.w_b_O[points])
                for e in self.loads
            ),
            inertial_torques=None if torques is None else torques.at(points),
            rates=rates,
            accelerations=limited,
            timing=None if self.timing is None else self.timing[points],
        )

    @property
    def stations(self) -> Indices:
        """Return grid point and interval of every place with constraints, (S, 2) integers.

        These are both ends of every interval, in order. A single grid point has the interval -1.
        """
        intervals = np.arange(len(self.s) - 1)
        if not len(intervals):
            return np.array([[0, -1]])
        both = [[intervals, intervals], [intervals + 1, intervals]]
        return np.array(both).transpose(2, 0, 1).reshape(-1, 2)

    def timescale(self) -> float:
        """Return a typical duration [s], as a unit: from the limits of duration, speed or force."""
        if math.isfinite(self.duration):
            return self.duration
        if len(self.s) < 2:
            return 1.0
        if self.rates is not None:
            fastest = 1.0 / np.sqrt(self.rates.largest()[0])
            if (bound := float(np.trapezoid(fastest, self.s))) > 0.0:
                return bound
        load = self.loads[0]
        inertia = np.linalg.norm(load.w_a_B, axis=1).max() * (self.s[-1] - self.s[0])
        weight = max(problem.load for problem in load.problems)
        return math.sqrt(inertia / weight) if inertia > 0.0 and weight > 0.0 else 1.0
