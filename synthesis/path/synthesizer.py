r"""Solves path problems on Clarabel, to its full accuracy, and proves what it says.

The friction margin is found as in :mod:`synthesis.synthesizer`, by Dinkelbach's method, here with
the utilisations of all contacts at all stations as its ratios. A force rate is not convex: its
problem is solved again and again, with an inner approximation about the last timing that was found,
see :mod:`synthesis.path.rates`. What comes of it is feasible, and a local optimum.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import clarabel
import numpy as np

from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.contact import ContactModel
from fulcrum.synthesis.errors import SolverError, UnboundedError
from fulcrum.synthesis.path.form import PathForm
from fulcrum.synthesis.path.problem import PathObjective, PathProblem
from fulcrum.synthesis.path.solution import InfeasiblePathError, PathSolution
from fulcrum.synthesis.solver import SOLVED, fallback_settings, solver_settings

# How far limits may be exceeded before the problem is solved again about the last timing, with its
# viscous friction, as a share [-]; and how often that may be.
_EXCESS = 1e-6
_SOLVES = 10
# The least improvement of the friction utilisation that is worth another solve [-].
_MARGIN_TOLERANCE = 1e-4
_MARGIN_SOLVES = 30
# With a force rate: the least improvement that is worth another solve, as a share; how often that
# may be; and how often the rate of the first pace is halved.
_RATE_TOLERANCE = 1e-3
_RATE_SOLVES = 40
_HALVINGS = 8
# The square of how much slower than the last pace the next one may be, where the solver stalls.
_SLOWER = (1.0, 0.98, 0.96)
# Whether Clarabel equilibrates them, and its static regularisation [-]: where one stalls the next
# does not.
_RATE_SETTINGS = ((False, 1e-8), (False, 1e-7), (True, 1e-7), (True, 1e-6))
# Normal forces below this share of the largest load count as none: their cones are noise.
_LOADED = 1e-6
# A proof of infeasibility: violation of its conditions relative to what it proves.
_PROVEN = 1e-6
_NAMED = 3


def solve_path(problem: PathProblem) -> PathSolution:
    """The optimal timing and forces.

    Raises:
        InfeasiblePathError: No timing and forces satisfy the constraints; says where and which.
        UnboundedError: The objective improves without limit, as with a grip that nothing bounds.
        SolverError: The solver gave neither, or repeated solves do not settle viscous friction or
            the force rate.
    """
    if problem.force_rate is None or problem.timing is not None or len(problem.s) < 2:
        return _settled(problem)
    return _within_force_rate(problem)


def _settled(problem: PathProblem, pace: Array | None = None) -> PathSolution:
    """The optimum with viscous friction at the exact rate, about a pace with a force rate."""
    found = _optimum(PathForm(problem, pace=pace))
    iterations, solve_s = found.iterations, found.solve_s
    for _ in range(_SOLVES):
        if found.residuals.primal <= _EXCESS:
            return replace(found, iterations=iterations, solve_s=solve_s)
        found = _optimum(PathForm(problem, found.b, pace=pace))
        iterations += found.iterations
        solve_s += found.solve_s
    raise SolverError(f"no convergence of viscous friction in {_SOLVES} solves")


def _within_force_rate(problem: PathProblem) -> PathSolution:
    """Repeated solves, each about the last one's pace, which only get better.

    The first pace is that of the least time without force rate, or the same motion slower: forces
    tend to those at rest, whose change along the path is finite, and so slow enough keeps any limit
    where these do not jump. The error is that about the slowest pace. Other objectives than the
    least time, and a largest duration, come after that. As the problem is not convex, an error
    proves that there is no solution about the pace that was tried, not that there is none at all.
    """
    quick = replace(problem, objective=PathObjective.LEAST_TIME, duration=math.inf)
    found = _settled(replace(quick, force_rate=None))
    spent = [found]
    for halvings in range(_HALVINGS + 1):
        try:
            pace = found.b / 4.0**halvings
            pace[[0, -1]] = found.b[[0, -1]]
            found = _settled(quick, pace)
            break
        except (InfeasiblePathError, SolverError):
            if halvings == _HALVINGS:
                raise
    spent += _improved(quick, found)
    if problem.objective is not PathObjective.LEAST_TIME or math.isfinite(problem.duration):
        spent += _improved(problem, _settled(problem, spent[-1].b))
    iterations, solve_s = sum(e.iterations for e in spent), sum(e.solve_s for e in spent)
    return replace(spent[-1], iterations=iterations, solve_s=solve_s)


def _improved(problem: PathProblem, found: PathSolution) -> list[PathSolution]:
    """Solutions one after the other until the value hardly changes, the best one last."""
    every = [found]
    for _ in range(_RATE_SOLVES):
        every.append(_about(problem, every[-1].b))
        if every[-1].value >= (1.0 - _RATE_TOLERANCE) * every[-2].value:
            return sorted(every, key=lambda each: -each.value)
    raise SolverError(f"no convergence of the force rate in {_RATE_SOLVES} solves")


def _about(problem: PathProblem, pace: Array) -> PathSolution:
    """The optimum about a pace, or where the solver stalls about one that is hardly slower."""
    for slower in _SLOWER[:-1]:
        with contextlib.suppress(SolverError):
            return _settled(problem, slower * pace)
    return _settled(problem, _SLOWER[-1] * pace)


def _optimum(form: PathForm) -> PathSolution:
    if form.problem.objective is PathObjective.FRICTION_MARGIN:
        return _largest_margin(form)
    # Slow paces make the last digit hard to get; residuals are those of the answer in any case.
    accepted = ("Solved",) if form.problem.force_rate is None else SOLVED
    found = solve_form(form, 1.0, None, accepted)
    return found.solution(form, form.value(found.every))


@dataclass(frozen=True, eq=False)
class Found:
    """One solve.

    Attributes:
        every: All variables.
        least: The objective in the solver's units.
        dual, gap: See :class:`PathResiduals`.
        iterations: Interior-point iterations.
        solve_s: Time inside the solver [s].
    """

    every: Array
    least: float
    dual: float
    gap: float
    iterations: int
    solve_s: float

    def solution(self, form: PathForm, value: float) -> PathSolution:
        """The same by its names, with a value of the objective."""
        return PathSolution(
            problem=form.problem,
            value=value,
            b=form.squared_rates(self.every),
            w_OC_C=form.wrenches(self.every),
            dual=self.dual,
            gap=self.gap,
            iterations=self.iterations,
            solve_s=self.solve_s,
        )


def solve_form(
    form: PathForm, utilisation: float, slack: list[Array] | None, accepted: tuple[str, ...]
) -> Found:
    """One solve of a form.

    Args:
        form: The form.
        utilisation, slack: See :meth:`PathForm.matrices`.
        accepted: What the solver may say of an answer.

    Raises:
        InfeasiblePathError: There is none; says where and which limits.
        UnboundedError: The objective improves without limit.
        SolverError: The solver gave neither.
    """
    A, h = form.matrices(utilisation, slack)
    started = time.perf_counter()
    iterations = 0
    status = ""
    for settings in _settings(form.problem.force_rate is not None):
        result = clarabel.DefaultSolver(form.P, form.q, A, h, form.rows.cones, settings).solve()
        iterations += result.iterations
        status = str(result.status)
        z = np.array(result.z)
        match status:
            case "PrimalInfeasible":
                raise _proof(form, A, h, z)
            case "DualInfeasible":
                raise UnboundedError(form.problem.objective)
            case accurate if accurate in accepted:
                x = np.array(result.x)
                solve_s = time.perf_counter() - started
                dual, gap = _optimality(form, A, h, x, z)
                least = float(form.q @ x)
                return Found(form.completed(x), least, dual, gap, iterations, solve_s)
    raise SolverError(status)


def _settings(rate_limited: bool) -> Iterator[clarabel.DefaultSettings]:
    """First without iterative refinement, in half the time: the solver stops by true residuals.

    Problems with force rates are scaled already, and where they are degenerate, as always, the
    linear algebra stalls short of the accuracy with one of the settings, but not with all.
    """
    for equilibrated, regularisation in _RATE_SETTINGS if rate_limited else ():
        settings = solver_settings()
        settings.equilibrate_enable = equilibrated
        settings.static_regularization_constant = regularisation
        yield settings
    quick = solver_settings()
    quick.iterative_refinement_enable = False
    yield quick
    yield solver_settings()
    yield from fallback_settings()


def _optimality(form: PathForm, A: Array, h: Array, x: Array, z: Array) -> tuple[float, float]:
    """Violation of stationarity and dual cones, and the gap relative to the value."""
    quadratic = form.P @ x
    stationarity = float(np.abs(quadratic + form.q + A.T @ z).max())
    primal, dual = 0.5 * x @ quadratic + form.q @ x, -0.5 * x @ quadratic - h @ z
    gap = float(abs(primal - dual)) / max(1.0, float(abs(primal)))
    return max(stationarity, form.rows.dual_violation(z)), gap


def _proof(form: PathForm, A: Array, h: Array, z: Array) -> InfeasiblePathError:
    """What a ray of multipliers proves: the limits that weigh most, and where."""
    value = -float(h @ z)
    violation = max(float(np.abs(A.T @ z).max()), form.rows.dual_violation(z))
    if not violation <= _PROVEN * value:
        raise SolverError("PrimalInfeasible without a proof")
    heaviest: dict[str, tuple[float, float]] = {}
    for weight, s, name in form.rows.weights(z / value):
        if weight > heaviest.get(name, (0.0, s))[0]:
            heaviest[name] = weight, s
    ordered = sorted(heaviest, key=lambda name: -heaviest[name][0])[:_NAMED]
    return InfeasiblePathError([(name, heaviest[name][1]) for name in ordered])


def _largest_margin(form: PathForm) -> PathSolution:
    """Dinkelbach's method; every iterate is feasible, so that stopping early costs margin only."""
    found = solve_form(form, 1.0, None, SOLVED)
    best = found.solution(form, 0.0)
    iterations, solve_s = found.iterations, found.solve_s
    s, slack = _largest_utilisation(form, best)
    for _ in range(_MARGIN_SOLVES):
        if not any(d.any() for d in slack):
            break
        found = solve_form(form, s, slack, SOLVED)
        iterations += found.iterations
        solve_s += found.solve_s
        last = found.solution(form, 0.0)
        ratio, slack = _largest_utilisation(form, last)
        better = s - ratio
        if better > 0.0:
            best, s = last, ratio
        if better < _MARGIN_TOLERANCE:
            break
    else:
        raise SolverError(f"no convergence of the friction margin in {_MARGIN_SOLVES} solves")
    return replace(best, value=s, iterations=iterations, solve_s=solve_s)


def _largest_utilisation(form: PathForm, found: PathSolution) -> tuple[float, list[Array]]:
    """The largest utilisation of loaded contacts, and the normal forces of those, (S, m) each."""
    worst, slack = 0.0, []
    for load, w_OC_C, used in zip(form.problem.loads, found.w_OC_C, found.utilisation, strict=True):
        f_n = w_OC_C[..., N]
        rough = [c.model is not ContactModel.FRICTIONLESS for c in load.problems[0].contacts]
        loaded = (f_n > _LOADED * form.unit) & np.array(rough)
        worst = max(worst, float(used[loaded].max(initial=0.0)))
        slack.append(np.where(loaded, f_n, 0.0))
    return worst, slack
