r"""Forces and timing along a path at once: problem (17) at every grid point, with inertia.

The path coordinate s runs over a grid :math:`s_0 < \dots < s_N`; its timing is
:math:`b = \dot s^2` at the grid points and :math:`a = \ddot s`, constant between them, so that
:math:`b_{k+1} - b_k = 2 a_k (s_{k+1} - s_k)` holds exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from fulcrum.synthesis import ContactModel, InvalidInputError, Problem
from fulcrum.synthesis.arrays import Array, Indices
from fulcrum.synthesis.path.limits import Accelerations, Rates, check_array


class PathObjective(StrEnum):
    """What is minimised along the path."""

    LEAST_TIME = "least-time"
    LEAST_EFFORT = "least-effort"
    FRICTION_MARGIN = "friction-margin"

    @property
    def needs_duration(self) -> bool:
        """Whether only a largest duration makes the answer finite and useful."""
        return self is not PathObjective.LEAST_TIME


@dataclass(frozen=True, eq=False)
class InertialTorques:
    r"""What motion costs in joint torque: :math:`\tau_a a + \tau_b b + \tau_c \sqrt b`.

    Along joint angles q(s) the robot's dynamics give :math:`\tau_a = M q'`,
    :math:`\tau_b = M q'' + C(q, q') q'` and, with viscous joint friction D, :math:`\tau_c = D q'`.

    Attributes:
        tau_a, tau_b, tau_c: (K, l).
    """

    tau_a: Array
    tau_b: Array
    tau_c: Array

    def __post_init__(self) -> None:
        for name in ("tau_a", "tau_b", "tau_c"):
            check_array(f"inertial_torques.{name}", getattr(self, name), np.shape(self.tau_a))


@dataclass(frozen=True, eq=False)
class Load:
    r"""An object that is moved along the path: contacts, weight and inertia at every grid point.

    Attributes:
        problems: (17) at rest, at each of the K grid points; their objectives do not count.
        w_a_O, w_b_O: The wrench that accelerates the object, in its frame, is
            :math:`w_a a + w_b b` [N, N·m], (K, 6).
        w_a_B, w_b_B: The same about the point B of each problem; not to be given.

    Raises:
        InvalidInputError: Shapes differ, or the problems are not of one structure.
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
        check_array("load.w_a_O", self.w_a_O, (points, 6))
        check_array("load.w_b_O", self.w_b_O, (points, 6))
        for name, w_O in (("w_a_B", self.w_a_O), ("w_b_B", self.w_b_O)):
            pairs = zip(self.problems, w_O, strict=True)
            object.__setattr__(self, name, np.array([p.about_B(w) for p, w in pairs]))
        first = self.problems[0]
        for k, problem in enumerate(self.problems):
            same = problem.contacts == first.contacts
            same &= (problem.joints is None) == (first.joints is None)
            if same and problem.joints is not None and first.joints is not None:
                same = problem.joints.names == first.joints.names
                for bound in ("tau_min", "tau_max"):
                    finite = np.isfinite(getattr(problem.joints, bound))
                    same &= bool((finite == np.isfinite(getattr(first.joints, bound))).all())
            if not same:
                valid = "the contacts, joints and kinds of limits of the first"
                raise InvalidInputError(f"load.problems[{k}]", "another structure", valid)


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

    at both ends of every interval of the grid, each with that interval's a: accelerations, and with
    them forces, jump at grid points. With a single grid point a = b = 0, and it is (17).

    Several loads are an uncertain object: a and b and the normal forces of the hands serve all of
    them, while friction and the environment's forces are each load's own.

    Objectives: the duration; the mean over the path of the sum of squared torque utilisations
    :math:`2\tau / (\tau_{max} - \tau_{min})`; the largest friction utilisation.

    Attributes:
        s: The K grid points, increasing.
        loads: One or several.
        inertial_torques: Of the robot; None without joints.
        rates: Speed limits.
        accelerations: Acceleration limits.
        objective: Phi.
        duration: Largest duration T [s]; may be infinite.
        start_rate, end_rate: :math:`\dot s` at both ends [1/s].
        timing: b at the grid points [1/s^2], (K,), where the timing is given and forces alone are
            sought, with all limits but those of rates, accelerations and duration; else None.

    Raises:
        InvalidInputError: A field is non-finite, mis-shaped or senseless.
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
        check_array("s", self.s, (points,))
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
            check_array("rates.slopes", self.rates.slopes, (points, len(self.rates.names)))
        if self.accelerations is not None and len(self.accelerations.slopes) != points:
            given = f"{len(self.accelerations.slopes)} points"
            raise InvalidInputError("accelerations.slopes", given, f"{points} points")
        for name in ("start_rate", "end_rate"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InvalidInputError(name, value, "a finite rate >= 0 1/s")
        if not self.duration > 0.0:
            raise InvalidInputError("duration", self.duration, "a time > 0 s")
        if self.timing is not None:
            check_array("timing", self.timing, (points,))
            if (self.timing[1:-1] <= 0.0).any() or (self.timing < 0.0).any():
                raise InvalidInputError("timing", "rests on the way", "positive between the ends")
            if self.objective is PathObjective.LEAST_TIME:
                raise InvalidInputError("objective", self.objective, "one of forces, with a timing")
        elif self.objective.needs_duration and points > 1 and not math.isfinite(self.duration):
            asks = f"a finite time > 0 s, as objective {self.objective} asks"
            raise InvalidInputError("duration", self.duration, asks)

    def _check_alike(self, index: int, problem: Problem) -> None:
        """Refuses a load whose hands or joints are not those of the first load."""
        first = self.loads[0].problems[0]
        names = [[p.contacts[i].name for i in p.hands] for p in (problem, first)]
        joints = [() if p.joints is None else p.joints.names for p in (problem, first)]
        if names[0] != names[1] or joints[0] != joints[1]:
            valid = "the hands and joints of the first load"
            raise InvalidInputError(f"loads[{index}]", "other hands or joints", valid)
        if self.objective is PathObjective.FRICTION_MARGIN and all(
            c.model is ContactModel.FRICTIONLESS for c in problem.contacts
        ):
            raise InvalidInputError(
                "contacts", "no friction", f"friction, as objective {self.objective} asks"
            )

    def _check_torques(self, points: int) -> None:
        joints = self.loads[0].problems[0].joints
        if joints is None:
            if self.inertial_torques is not None:
                raise InvalidInputError("inertial_torques", "torques", "None without joints")
            if self.objective is PathObjective.LEAST_EFFORT:
                raise InvalidInputError("joints", None, f"joints, as {self.objective} asks")
            return
        if self.inertial_torques is None:
            raise InvalidInputError("inertial_torques", None, "torques, as there are joints")
        check_array(
            "inertial_torques.tau_a", self.inertial_torques.tau_a, (points, len(joints.names))
        )
        if self.objective is PathObjective.LEAST_EFFORT:
            usable = np.isfinite(joints.tau_min) & np.isfinite(joints.tau_max)
            usable &= joints.tau_min < joints.tau_max
            if not usable.all():
                worst = joints.names[int(np.argmin(usable))]
                asks = f"finite with tau_min < tau_max, as objective {self.objective} asks"
                raise InvalidInputError(f"limits of {worst}", "no finite range", asks)

    def at(self, points: Indices) -> PathProblem:
        """The same path on fewer of its grid points, by their indices."""

        torques, rates, limited = self.inertial_torques, self.rates, self.accelerations
        if torques is not None:
            parts = (torques.tau_a, torques.tau_b, torques.tau_c)
            torques = InertialTorques(*(tau[points] for tau in parts))
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
            inertial_torques=torques,
            rates=rates,
            accelerations=limited,
            timing=None if self.timing is None else self.timing[points],
        )

    @property
    def stations(self) -> Array:
        """Grid point and interval of every place where the constraints hold, (S, 2) integers.

        Both ends of every interval in order. A single grid point is a rest; its interval is -1.
        """
        intervals = np.arange(len(self.s) - 1)
        if not len(intervals):
            return np.array([[0, -1]])
        both = [[intervals, intervals], [intervals + 1, intervals]]
        return np.array(both).transpose(2, 0, 1).reshape(-1, 2)

    def timescale(self) -> float:
        """A time in which the path may be covered [s], for units: by speeds, or else by inertia."""
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
