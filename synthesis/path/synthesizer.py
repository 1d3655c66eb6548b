r"""Solves path problems on Clarabel to its full accuracy, with residuals or a proof.

The friction margin is found by Dinkelbach's method as in :mod:`synthesis.friction_margin`, here
with the utilisations of all contacts at all stations as the ratios.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import clarabel
import numpy as np

from fulcrum.synthesis import SolverError, UnboundedError
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.path.form import PathForm
from fulcrum.synthesis.path.problem import PathObjective, PathProblem
from fulcrum.synthesis.path.solution import InfeasiblePathError, PathSolution
from fulcrum.synthesis.solver import SOLVED, fallback_settings, solver_settings

# Largest excess over a limit, as a share [-]; above it the problem is solved again with the viscous
# friction of the last timing, up to this many times.
_EXCESS = 1e-6
_SOLVES = 10
# Smallest improvement of the friction utilisation for another solve [-].
_MARGIN_TOLERANCE = 1e-4
_MARGIN_SOLVES = 30
# Normal forces below this share of the largest load count as zero: their cones are noise.
_LOADED = 1e-6
# Largest violation of the conditions of a proof of infeasibility, relative to its value.
_PROVEN = 1e-6
# Number of limits that an error names.
_NAMED = 3


def solve_path(problem: PathProblem) -> PathSolution:
    """Return the optimal timing and forces.

    Raises:
        InfeasiblePathError: No timing and forces satisfy the constraints; names limits and places.
        UnboundedError: The objective improves without limit, for example without a grip limit.
        SolverError: The solver found neither, or repeated solves do not settle viscous friction.
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
    """The result of one solve.

    Attributes:
        every: All variables.
        least: Objective in the solver's units.
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
        """Return the solution of a form, with a value of its objective."""
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
    """Solve a form once.

    Args:
        form: The form.
        utilisation, slack: See :meth:`PathForm.matrices`.
        accepted: Statuses of the solver that count as a solution.

    Raises:
        InfeasiblePathError: There is no solution; names limits and places.
        UnboundedError: The objective improves without limit.
        SolverError: The solver found neither.
    """
    A, h = form.matrices(utilisation, slack)
    started = time.perf_counter()
    iterations = 0
    status = ""
    # Without iterative refinement takes half the time, and the solver stops by true residuals.
    quick = solver_settings()
    quick.iterative_refinement_enable = False
    for settings in (quick, solver_settings(), *fallback_settings()):
        result = clarabel.DefaultSolver(form.P, form.q, A, h, form.rows.cones, settings).solve()
        iterations += result.iterations
        status, z = str(result.status), np.array(result.z)
        if status == "PrimalInfeasible":
            raise _proof(form, A, h, z)
        if status == "DualInfeasible":
            raise UnboundedError(form.problem.objective)
        if status in accepted:
            x, solve_s = np.array(result.x), time.perf_counter() - started
            residuals = _optimality(form, A, h, x, z)
            return Found(form.completed(x), float(form.q @ x), *residuals, iterations, solve_s)
    raise SolverError(status)


def _optimality(form: PathForm, A: Array, h: Array, x: Array, z: Array) -> tuple[float, float]:
    """Return the violation of stationarity and dual cones, and the gap relative to the value."""
    quadratic = form.P @ x
    stationarity = float(np.abs(quadratic + form.q + A.T @ z).max())
    primal, dual = 0.5 * x @ quadratic + form.q @ x, -0.5 * x @ quadratic - h @ z
    gap = float(abs(primal - dual)) / max(1.0, float(abs(primal)))
    return max(stationarity, form.rows.dual_violation(z)), gap


def _proof(form: PathForm, A: Array, h: Array, z: Array) -> InfeasiblePathError:
    """Return the error that a ray of multipliers proves, with the heaviest limits and places."""
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
    """Apply Dinkelbach's method; every iterate is feasible, so stopping early only costs margin."""
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
    """Return the largest utilisation of loaded contacts, and their normal forces, (S, m) each."""
    worst, slack = 0.0, []
    for load, w_OC_C, used in zip(form.problem.loads, found.w_OC_C, found.utilisation, strict=True):
        f_n = w_OC_C[..., N]
        loaded = (f_n > _LOADED * form.unit) & load.problems[0].contact_set.rough
        worst = max(worst, float(used[loaded].max(initial=0.0)))
        slack.append(np.where(loaded, f_n, 0.0))
    return worst, slack
