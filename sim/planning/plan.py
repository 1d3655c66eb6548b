"""A planned tilt: timing and forces along a scenario's path, and their page."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from fulcrum.sim.model import RobotModel
from fulcrum.sim.planning.problem import CERTAIN, Margins, path_problem
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis import FulcrumError, InvalidInputError
from fulcrum.synthesis.arrays import Array, Indices
from fulcrum.synthesis.checks import positive
from fulcrum.synthesis.markdown import number
from fulcrum.synthesis.path import (
    InfeasiblePathError,
    PathObjective,
    PathProblem,
    PathSolution,
    solve_many,
)
from fulcrum.synthesis.render import Marked, Page, page, table, to_markdown
from fulcrum.synthesis.robust import UncertaintySet

# Share by which the solver's accuracy may exceed a limit [-].
_EXCESS = 1e-6
# Limits used by less than this share are not listed [-].
_LISTED = 0.5


class PlanError(FulcrumError):
    """No timing of the tilt keeps all limits; names the tightest limits and their tilt."""

    def __init__(self, scenario: str, what: str, binding: list[tuple[str, float]]) -> None:
        self.binding = binding
        named = [
            name if math.isnan(tilt) else f"{name} at {tilt:.1f} deg" for name, tilt in binding
        ]
        super().__init__(
            f"{scenario}: {what} breaks a limit; these limit it most: {', '.join(named)}."
        )


class Moment(NamedTuple):
    """A plan at one instant.

    Attributes:
        tilt, rate, acceleration: Tilt and its derivatives [rad, rad/s, rad/s^2].
        q, qd, qdd: Joint angles, speeds and accelerations [rad or m, per s, per s^2], (l,).
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,).
    """

    tilt: float
    rate: float
    acceleration: float
    q: Array
    qd: Array
    qdd: Array
    w_OC_C: Array
    tau: Array


class Along(NamedTuple):
    """A plan at many tilts.

    Attributes:
        rate: Rate of the tilt [rad/s], (k,).
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (k, m, 6).
        tau: Joint torques [N·m or N], (k, l).
    """

    rate: Array
    w_OC_C: Array
    tau: Array


@dataclass(frozen=True, eq=False)
class Plan:
    """Timing, joint motion and forces of a tilt, from rest to rest.

    Attributes:
        scenario: Scene of the tilt.
        margins: Distances kept to the limits.
        joints: Names of the joints.
        solution: Timing and forces; its path coordinate is the share of the tilt.
        q: Joint angles [rad or m] over that share.
        share: Share of the required uncertainty that the plan holds for [-]; 1 is all of it.
    """

    scenario: Scenario
    margins: Margins
    joints: tuple[str, ...]
    solution: PathSolution
    q: BSpline
    share: float = 1.0

    @cached_property
    def tilt(self) -> Array:
        """Tilt at the grid points [rad], (K,)."""
        return self.solution.problem.s * math.radians(self.scenario.path.angle_deg)

    @property
    def times(self) -> Array:
        """Times of the grid points [s], (K,)."""
        return self.solution.times

    @property
    def duration(self) -> float:
        """Duration of the tilt [s]."""
        return self.solution.duration

    @property
    def peak_rate(self) -> float:
        """Largest rate of the tilt [rad/s]."""
        return math.sqrt(self.solution.b.max()) * math.radians(self.scenario.path.angle_deg)

    def at(self, t: float) -> Moment:
        """Return the plan at a time [s]; it is at rest before its start and after its end.

        The timing is exact. Forces and torques are linear in the tilt between grid points, where
        they jump.
        """
        found = self.solution
        s = found.problem.s
        k = int(np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(s) - 2))
        elapsed = min(max(t - self.times[k], 0.0), self.times[k + 1] - self.times[k])
        start = math.sqrt(found.b[k])
        a, moving = float(found.a[k]), 0.0 <= t <= self.duration
        share = s[k] + elapsed * (start + a * elapsed / 2.0)
        rate = (start + a * elapsed) if moving else 0.0
        a = a if moving else 0.0
        part = float(np.clip((share - s[k]) / (s[k + 1] - s[k]), 0.0, 1.0))
        w, tau = self._between(np.array([k]), np.array([part]))
        end = math.radians(self.scenario.path.angle_deg)
        slope, curvature = self.q(share, 1), self.q(share, 2)
        return Moment(
            tilt=share * end,
            rate=rate * end,
            acceleration=a * end,
            q=self.q(share),
            qd=slope * rate,
            qdd=slope * a + curvature * rate**2,
            w_OC_C=w[0],
            tau=tau[0],
        )

    def _between(self, k: Indices, part: Array) -> tuple[Array, Array]:
        """Return wrenches, (n, m, 6), and torques, (n, l), at fractions of intervals k."""
        w, tau = self.solution.w_OC_C[0], self.solution.tau[0]
        first, second = 2 * k, 2 * k + 1
        w = w[first] + part[:, None, None] * (w[second] - w[first])
        return w, tau[first] + part[:, None] * (tau[second] - tau[first])

    def along(self, tilts: Array) -> Along:
        """Return the plan at tilts, with forces and torques as in :meth:`at`.

        Args:
            tilts: Tilts [rad], (k,), clipped to those of the plan.
        """
        found, s = self.solution, self.solution.problem.s
        share = np.clip(tilts / math.radians(self.scenario.path.angle_deg), s[0], s[-1])
        k = np.clip(np.searchsorted(s, share, side="right") - 1, 0, len(s) - 2)
        part = (share - s[k]) / (s[k + 1] - s[k])
        squared = found.b[k] + part * (found.b[k + 1] - found.b[k])
        rate = np.sqrt(np.maximum(squared, 0.0))
        w, tau = self._between(k, part)
        return Along(rate * math.radians(self.scenario.path.angle_deg), w, tau)

    def stretched(self, factor: float) -> Plan:
        """Return the same motion in ``factor`` times the duration, with newly computed forces.

        The forces are optimal for the plan's objective; for a plan in least time they have the
        largest friction margin.

        Args:
            factor: Factor on the duration, > 0; below 1 the motion is faster.

        Raises:
            PlanError: No forces exist, e.g. where only a faster motion has forces; names the tilt.
        """
        positive("stretch", factor)
        what = f"a tilt in {self.duration * factor:.3g} s"
        self._check_speeds(factor, what)
        timing, objective = self.solution.b / factor**2, self.solution.problem.objective
        if objective is PathObjective.LEAST_TIME:
            objective = PathObjective.FRICTION_MARGIN
        problem = replace(
            self.solution.problem, timing=timing, duration=math.inf, objective=objective
        )
        return replace(self, solution=_solve(self.scenario, problem, what))

    def _check_speeds(self, factor: float, what: str) -> None:
        """Refuse a motion beyond limits of speed or acceleration, which no forces change."""
        places = self.tilt[self.solution.problem.stations[:, 0]]
        broken: dict[str, tuple[float, float]] = {}
        for kind, power in (("speed", 1), ("acceleration", 2)):
            for name, used in self.solution.shares.items():
                k = int(used.argmax())
                excess = used[k] / factor**power - 1.0
                if name.startswith(f"{kind} of ") and excess > _EXCESS:
                    broken[name] = float(excess), float(np.degrees(places[k]))
        if broken:
            worst = max(broken, key=lambda name: broken[name][0])
            raise PlanError(self.scenario.name, what, [(worst, broken[worst][1])])

    def stretches(self) -> list[tuple[float, float, tuple[str, ...]]]:
        """Return the parts of the path with the same limits reached: from, to [deg], and limits."""
        used = self.solution.active()
        tilts = np.degrees(self.tilt)
        merged: list[tuple[float, float, tuple[str, ...]]] = []
        for k in range(len(tilts) - 1):
            # A limit that is reached at either end of an interval is active in it.
            limits = tuple(dict.fromkeys((*used[2 * k], *used[2 * k + 1])))
            low, high = float(tilts[k]), float(tilts[k + 1])
            if merged and set(merged[-1][2]) == set(limits):
                merged[-1] = (merged[-1][0], high, merged[-1][2])
            else:
                merged.append((low, high, limits))
        return merged

    def page(self) -> Page:
        """Return duration, errors, the limits reached over the tilt, and the limits used most."""
        found, residuals = self.solution, self.solution.residuals
        places = np.degrees(self.tilt[found.problem.stations[:, 0]])
        used = sorted(found.shares.items(), key=lambda item: -item[1].max())
        worlds, share = len(found.problem.loads), f"{100 * self.share:.0f} %"
        grip = f"One grip holds in {worlds} worlds: in {share} of the uncertainty set"
        return page(
            (
                Marked(f"{self.scenario.name}, {found.problem.objective}"),
                ": ",
                Marked(f"{self.duration:.4f} s"),
                f" for {number(self.scenario.path.angle_deg)} deg, at most "
                f"{math.degrees(self.peak_rate):.1f} deg/s; solved in {1e3 * found.solve_s:.0f} ms",
            ),
            f"{grip} of controller robust." if len(found.problem.loads) > 1 else "",
            f"Relative errors: limits and balance {max(residuals.primal, 0.0):.1e}, optimality "
            f"{max(residuals.dual, residuals.gap):.1e}.",
            table(
                ("tilt [deg]", "limits reached"),
                [
                    (f"{low:.1f} to {high:.1f}", ", ".join(limits) or "none")
                    for low, high, limits in self.stretches()
                ],
            ),
            table(
                ("limit", "used at most [%]", "at [deg]"),
                [
                    (name, f"{100.0 * share.max():.1f}", f"{places[int(share.argmax())]:.1f}")
                    for name, share in used
                    if share.max() >= _LISTED
                ],
            ),
        )

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


def plan(
    scenario: Scenario,
    margins: Margins,
    objective: PathObjective = PathObjective.LEAST_TIME,
    duration: float = math.inf,
    points: int = 100,
    uncertainty: UncertaintySet = CERTAIN,
    robot: RobotModel | None = None,
) -> Plan:
    """Plan the tilt of a scenario.

    Args:
        scenario: The scene; timing and grip of its phases are not used.
        margins: Margins to all limits.
        objective: Objective that is minimised.
        duration: Longest duration of the tilt [s].
        points: Number of grid points, at least 3.
        uncertainty: Deviations for all of which the plan holds, with one timing and one grip.
        robot: Model of the scenario's robots; built if left out.

        Raises:
            InvalidInputError: An argument is invalid.
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits.
    """
    if points < 3:
        raise InvalidInputError("points", points, "an integer >= 3")
    problem, curve, joints = path_problem(scenario, margins, points, uncertainty, robot)
    problem = replace(problem, objective=objective, duration=duration)
    what = "every tilt" if math.isinf(duration) else f"every tilt in at most {duration:g} s"
    return Plan(scenario, margins, joints, _solve(scenario, problem, what), curve)


def _solve(scenario: Scenario, problem: PathProblem, what: str) -> PathSolution:
    try:
        return solve_many(problem)
    except InfeasiblePathError as error:
        binding = [(name, s * scenario.path.angle_deg) for name, s in error.binding]
        raise PlanError(scenario.name, what, binding) from error
