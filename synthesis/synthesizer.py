r"""Solves contact force synthesis problems on Clarabel, one prebuilt solver per structure.

The friction margin, the smallest largest utilisation :math:`\|f_t\| / f_n` of all contacts, is a
ratio and so quasi-convex. It is found by Dinkelbach's method for the largest of several ratios
(Crouzeix, Ferland, Schaible 1985): at the utilisation :math:`s` of the last forces solve

.. math:: \min \lambda \quad \text{s.t. (12), (15), (16), (7)},\quad
          \|f_{t,i}\| \le s f_{n,i} + \lambda d_i

with :math:`d_i` the last normal forces, starting from :math:`s = d_i = 1` with
:math:`\lambda \le 0`, which is feasible exactly if (17) is. A negative :math:`\lambda` gives
forces with a smaller utilisation; none is left when :math:`\lambda = 0`. It converges
superlinearly, in 4 to 8 solves. An unloaded contact has no utilisation; its :math:`d_i = 0`
keeps it within the cone at s without letting it hold the others back.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace

import clarabel
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from synthesis.conic import ConicForm, structure
from synthesis.contact import Array, ContactModel, N
from synthesis.errors import InfeasibleError, SolverError, UnboundedError
from synthesis.problem import Objective, Problem
from synthesis.solution import Solution, certificate

# Feasibility and gap, relative: well under the 1e-6 to which the torque matters. On degenerate
# problems the linear algebra stalls a little above the first; the second is accepted, too.
TOLERANCE = 1e-9
_ACCEPTED_TOLERANCE = 1e-8
_MARGIN_TOLERANCE = 1e-9
_MARGIN_SOLVES = 50
_SOLVED = ("Solved", "AlmostSolved")
_PROVEN = ("PrimalInfeasible", "DualInfeasible")
# Where the prebuilt solver stalls, these static regularisations [-] are tried in turn: almost none
# resolves problems on the brink of infeasibility, much those with an ill-conditioned optimum.
_FALLBACK_REGULARISATIONS = (1e-12, 1e-6)
# The solver's feasibility is relative to its largest number, which may be an absurd bound.
_WORST_IMBALANCE = 1e-6
# Normal forces below this fraction of the largest force count as none: their cones are noise.
_LOADED = 1e-6


def solver_settings() -> clarabel.DefaultSettings:
    """Quiet, single-threaded and tight; with the right to update the data."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = TOLERANCE
    settings.reduced_tol_feas = _ACCEPTED_TOLERANCE
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = _ACCEPTED_TOLERANCE
    settings.tol_infeas_abs = settings.tol_infeas_rel = TOLERANCE
    # These three would remove rows or entries, and with them the right to update the data.
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    settings.input_sparse_dropzeros = False
    return settings


class Synthesizer:
    """Solves problems, and keeps a solver for each problem structure that it has met.

    Example:
        >>> solution = Synthesizer().solve(problem)
        >>> solution.wrench("left")
    """

    def __init__(self) -> None:
        self._compiled: dict[Hashable, _Compiled] = {}

    def solve(self, problem: Problem) -> Solution:
        """Solves (17).

        Raises:
            InfeasibleError: No forces satisfy the constraints; carries the certificate.
            UnboundedError: The objective improves without limit.
            SolverError: The solver gave neither.
        """
        key = structure(problem)
        compiled = self._compiled.get(key)
        if compiled is None:
            compiled = self._compiled[key] = _Compiled(problem)
        if problem.objective is Objective.FRICTION_MARGIN:
            return _largest_margin(compiled, problem)
        return compiled.solve(problem)


@dataclass(frozen=True)
class _Parameters:
    """Parameters of the friction-margin problem: utilisation s [-] and slack scales d, (m,)."""

    s: float = 1.0
    d: Array | None = None


class _Compiled:
    """A Clarabel solver for one structure; its sparsity holds for all numbers."""

    def __init__(self, problem: Problem) -> None:
        self.form = ConicForm(problem)
        self._pattern = sp.csc_matrix(self.form.sparsity(problem), dtype=np.float64)
        self._rows = self._pattern.indices
        self._columns = np.repeat(np.arange(self.form.columns), np.diff(self._pattern.indptr))
        A, b = self.form.matrices(problem)
        self._solver = self._build(A[self._rows, self._columns], b, solver_settings())

    def solve(self, problem: Problem, parameters: _Parameters = _Parameters()) -> Solution:
        """One conic solve; for the friction margin the value is lambda."""
        A, b = self.form.matrices(problem, parameters.s, parameters.d)
        scale = self.form.row_scale(b)
        result = self._run(A * scale[:, None], b * scale)
        multipliers = self.form.multipliers(problem, np.array(result.z) * scale, parameters.s)
        match str(result.status):
            case "PrimalInfeasible":
                raise InfeasibleError(certificate(problem, multipliers))
            case "DualInfeasible":
                raise UnboundedError(problem.objective)
        x = np.array(result.x)
        w_OC_C = self.form.wrenches(problem, x)
        return Solution(
            problem=problem,
            value=self.form.value(problem, x),
            w_OC_C=w_OC_C,
            tau=problem.torque(w_OC_C),
            multipliers=multipliers,
            iterations=result.iterations,
            solve_s=result.solve_time,
        )

    def _run(self, A: Array, b: Array) -> clarabel.DefaultSolution:
        """Solves with the prebuilt solver, or, where that stalls, with differently set ones."""
        data = A[self._rows, self._columns]
        self._solver.update(A=data, b=b)
        result = self._solver.solve()
        if self._decides(result, A, b):
            return result
        for regularisation in _FALLBACK_REGULARISATIONS:
            settings = solver_settings()
            settings.equilibrate_enable = False
            settings.static_regularization_constant = regularisation
            result = self._build(data, b, settings).solve()
            if self._decides(result, A, b):
                return result
        raise SolverError(str(result.status))

    def _decides(self, result: clarabel.DefaultSolution, A: Array, b: Array) -> bool:
        """Whether a result is a proof of infeasibility or unboundedness, or balances the object."""
        status = str(result.status)
        if status not in _SOLVED:
            return status in _PROVEN
        x, rows = np.array(result.x), self.form.equilibrium_rows
        largest = max(1.0, float(np.abs(x[: self.form.aux_column]).max()))
        return bool(np.abs(A[rows] @ x - b[rows]).max() <= _WORST_IMBALANCE * largest)

    def _build(
        self, data: Array, b: Array, settings: clarabel.DefaultSettings
    ) -> clarabel.DefaultSolver:
        A = self._pattern.copy()
        A.data[:] = data
        P = sp.csc_matrix((self.form.columns, self.form.columns))
        q = np.zeros(self.form.columns)
        q[self.form.aux_column] = 1.0
        return clarabel.DefaultSolver(P, q, A, b, self.form.clarabel_cones, settings)


def _largest_margin(compiled: _Compiled, problem: Problem) -> Solution:
    """Dinkelbach's method; every iterate is feasible, so that stopping early costs margin only."""
    unit = compiled.form.force_unit(problem)
    best = last = compiled.solve(problem)
    iterations, solve_s = last.iterations, last.solve_s
    s, loaded = _largest_utilisation(last, unit)
    for _ in range(_MARGIN_SOLVES):
        if not loaded.any():
            break
        slack = np.where(loaded, last.w_OC_C[:, N], 0.0)
        try:
            last = compiled.solve(problem, _Parameters(s=s, d=slack))
        except InfeasibleError:  # At s the cones are left by noise alone.
            break
        iterations += last.iterations
        solve_s += last.solve_s
        before = loaded
        ratio, loaded = _largest_utilisation(last, unit)
        best = replace(last if ratio < s else best, multipliers=last.multipliers)
        stalled = ratio > s - _MARGIN_TOLERANCE and (loaded == before).all()
        if stalled or last.value > -_MARGIN_TOLERANCE:
            break
        s = min(s, ratio)
    else:
        raise SolverError(f"no convergence of the friction margin in {_MARGIN_SOLVES} solves")
    value, _ = _largest_utilisation(best, unit)
    return replace(best, value=value, iterations=iterations, solve_s=solve_s)


def _largest_utilisation(solution: Solution, unit: float) -> tuple[float, NDArray[np.bool_]]:
    """The largest utilisation of the loaded contacts with friction, and which they are, (m,)."""
    f_n = solution.w_OC_C[:, N]
    loaded = f_n > _LOADED * max(unit, f_n.max())
    loaded &= [c.model is not ContactModel.FRICTIONLESS for c in solution.problem.contacts]
    return float(solution.utilisation[loaded].max(initial=0.0)), loaded
