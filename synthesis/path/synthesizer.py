r"""Solves path problems on Clarabel, to its full accuracy, and proves what it says.

The friction margin is found as in :mod:`synthesis.synthesizer`, by Dinkelbach's method, here with
the utilisations of all contacts at all stations as its ratios.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import clarabel
import numpy as np

from fulcrum.synthesis import ContactModel, SolverError, UnboundedError
from fulcrum.synthesis.arrays import Array, N
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
        SolverError: The solver gave neither, or repeated solves do not settle viscous friction.
    """
    found = _optimum(PathForm(problem))
    iterations, solve_s = found.iterations, found.solve_s
    for _ in range(_SOLVES):
        if found.residuals.primal <= _EXCESS:
            return replace(found, iterations=iterations, solve_s=solve_s)
        found = _optimum(PathForm(problem, found.b))
        iterations += found.iterations
        solve_s += found.solve_s
    raise SolverError(f"no convergence of viscous friction in {_SOLVES} solves")


def _optimum(form: PathForm) -> PathSolution:
    if form.problem.objective is PathObjective.FRICTION_MARGIN:
        return _largest_margin(form)
    found = solve_form(form, 1.0, None, ("Solved",))
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
    for settings in _settings():
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


def _settings() -> Iterator[clarabel.DefaultSettings]:
    """First without iterative refinement, in half the time: the solver stops by true residuals."""
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
