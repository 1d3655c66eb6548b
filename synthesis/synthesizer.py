r"""Solves contact force synthesis problems on Clarabel, one prebuilt solver per structure.

Torque limits are most of (17)'s numbers and bind seldom. So a problem is first attempted without
them: over a larger set the optimum is no worse, so that one which happens to keep (16) is optimal
for (17), with multipliers of zero for (16); and multipliers that prove the relaxed problem
infeasible prove (17) so. The attempt also goes without iterative refinement: Clarabel stops by
residuals that it computes from the data, whatever the accuracy of its steps. It counts if it is
``Solved`` to the full tolerance, balances the object and keeps (16); or if its proof of
infeasibility holds. On anything else the whole problem is solved, carefully. The friction margin,
which squeezes until a limit binds, is not attempted; see
:mod:`synthesis.friction_margin`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable
from functools import partial
from operator import le

import clarabel
import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.conic import ConicForm, structure
from fulcrum.synthesis.errors import SolverError, UnboundedError
from fulcrum.synthesis.friction_margin import AS_IT_STANDS, Parameters, largest_margin
from fulcrum.synthesis.problem import Joints, Objective, Problem
from fulcrum.synthesis.solution import InfeasibleError, Multipliers, Solution, certificate
from fulcrum.synthesis.solver import SOLVED, fallback_settings, solver_settings

_PROVEN = ("PrimalInfeasible", "DualInfeasible")
# The solver's feasibility is relative to its largest number, which may be an absurd bound.
_WORST_IMBALANCE = 1e-6
# What an attempt must keep, where there is a second chance.
_IMBALANCE = 1e-8
# An attempt's proof of infeasibility must hold for forces up to this many times the load [-].
_FARTHEST = 1e4
# After an attempt that failed, so many problems of the structure are solved with all rows at once:
# torque limits that bind at one tick bind at the next, and a futile attempt costs a third again.
_REST = 16


class Synthesizer:
    """Solves problems, and keeps a solver for each problem structure that it has met.

    Example:
        >>> solution = Synthesizer().solve(problem)
        >>> solution.wrench("left")
    """

    def __init__(self) -> None:
        self._attempts: dict[Hashable, _Program] = {}
        self._programs: dict[Hashable, _Program] = {}

    def solve(self, problem: Problem) -> Solution:
        """Solves (17).

        Raises:
            InfeasibleError: No forces satisfy the constraints; carries the certificate.
            UnboundedError: The objective improves as long as forces grow.
            SolverError: The solver gave neither.
        """
        if problem.objective is Objective.FRICTION_MARGIN:
            return largest_margin(self._solve, problem)
        quick = self._program(self._attempts, problem, careful=False)
        if quick.rest:
            quick.rest -= 1
        else:
            solution = quick.attempt(problem)
            if solution is not None:
                return solution
            quick.rest = _REST
        return self._solve(problem, AS_IT_STANDS)

    def _solve(self, problem: Problem, parameters: Parameters) -> Solution:
        """One careful solve; for the friction margin the value is lambda."""
        return self._program(self._programs, problem, careful=True).solve(problem, parameters)

    @staticmethod
    def _program(programs: dict[Hashable, _Program], problem: Problem, careful: bool) -> _Program:
        key = structure(problem, torque_limits=careful)
        program = programs.get(key)
        if program is None:
            program = programs[key] = _Program(problem, careful)
        return program


class _Program:
    """A Clarabel solver for one structure; its sparsity holds for all numbers.

    Attributes:
        form: The structure.
        rest: How many problems are yet to be left to the careful program.
    """

    def __init__(self, problem: Problem, careful: bool) -> None:
        """Builds the solver.

        Args:
            problem: Any problem of the structure.
            careful: Whether with all rows and iterative refinement, for :meth:`solve`; else without
                the torque limits and without refinement, for :meth:`attempt`.
        """
        self.rest = 0
        self.form = ConicForm(problem, torque_limits=careful)
        self._pattern = sp.csc_matrix(self.form.sparsity(problem), dtype=np.float64)
        rows = self._pattern.indices
        columns = np.repeat(np.arange(self.form.columns), np.diff(self._pattern.indptr))
        self._entries = rows * self.form.columns + columns
        settings = solver_settings()
        settings.iterative_refinement_enable = careful
        A, b = self.form.matrices(problem)
        self._solver = self._build(A.take(self._entries), b, settings)

    def attempt(self, problem: Problem) -> Solution | None:
        """Solves without the torque limits; None where that is not the answer to (17)."""
        parameters = AS_IT_STANDS
        started = time.perf_counter()
        A, b, scale = self._scaled(problem, parameters)
        result = self._update_and_solve(A, b)
        status = str(result.status)
        if status == "PrimalInfeasible":
            proof = certificate(problem, self._multipliers(problem, result, scale, parameters)())
            if proof.proves(_FARTHEST * self.form.force_unit(problem)):
                raise InfeasibleError(proof)
        if status != "Solved":
            return None
        x = np.array(result.x)
        if not self._balances(x, A, b, _IMBALANCE):
            return None
        solution = self._solution(problem, result, x, scale, parameters, started)
        return solution if self._within_limits(problem.joints, solution.tau) else None

    @staticmethod
    def _within_limits(joints: Joints | None, tau: Array) -> bool:
        if joints is None:
            return True
        given = tau.tolist()  # lists, for so few numbers, are the quicker
        low, high = joints.tau_min.tolist(), joints.tau_max.tolist()
        return all(map(le, low, given)) and all(map(le, given, high))

    def solve(self, problem: Problem, parameters: Parameters) -> Solution:
        """Solves all of (17), with differently set solvers where the prebuilt one stalls."""
        started = time.perf_counter()
        A, b, scale = self._scaled(problem, parameters)
        result = self._decided(A, b)
        match str(result.status):
            case "PrimalInfeasible":
                multipliers = self._multipliers(problem, result, scale, parameters)
                raise InfeasibleError(certificate(problem, multipliers()))
            case "DualInfeasible":
                raise UnboundedError(problem.objective)
        return self._solution(problem, result, np.array(result.x), scale, parameters, started)

    def _scaled(
        self, problem: Problem, parameters: Parameters
    ) -> tuple[Array, Array, Array | float]:
        A, b = self.form.matrices(problem, parameters.s, parameters.d)
        if not self.form.has_loose_limits(problem):
            return A, b, 1.0
        scale = self.form.row_scale(b)
        return A * scale[:, None], b * scale, scale

    def _update_and_solve(self, A: Array, b: Array) -> clarabel.DefaultSolution:
        # Clarabel reads lists three times as fast as arrays.
        self._solver.update(A=A.take(self._entries).tolist(), b=b.tolist())
        return self._solver.solve()

    def _decided(self, A: Array, b: Array) -> clarabel.DefaultSolution:
        result = self._update_and_solve(A, b)
        if self._decides(result, A, b):
            return result
        for settings in fallback_settings():
            result = self._build(A.take(self._entries), b, settings).solve()
            if self._decides(result, A, b):
                return result
        raise SolverError(str(result.status))

    def _decides(self, result: clarabel.DefaultSolution, A: Array, b: Array) -> bool:
        """Whether a result is a proof of infeasibility or unboundedness, or balances the object."""
        status = str(result.status)
        if status not in SOLVED:
            return status in _PROVEN
        return self._balances(np.array(result.x), A, b, _WORST_IMBALANCE)

    def _balances(self, x: Array, A: Array, b: Array, tolerance: float) -> bool:
        rows = self.form.equilibrium_rows
        imbalance, forces = A[rows].dot(x) - b[rows], x[: self.form.aux_column]
        size = max(1.0, math.sqrt(forces.dot(forces)))
        return math.sqrt(imbalance.dot(imbalance)) <= tolerance * size

    def _multipliers(
        self,
        problem: Problem,
        result: clarabel.DefaultSolution,
        scale: Array | float,
        parameters: Parameters,
    ) -> Callable[[], Multipliers]:
        return partial(_unpack, self.form, problem, result.z, scale, parameters.s)

    def _solution(
        self,
        problem: Problem,
        result: clarabel.DefaultSolution,
        x: Array,
        scale: Array | float,
        parameters: Parameters,
        started: float,
    ) -> Solution:
        w_OC_C = self.form.wrenches(problem, x)
        return Solution(
            problem=problem,
            value=self.form.value(problem, x),
            w_OC_C=w_OC_C,
            tau=problem.torque(w_OC_C),
            unpack=self._multipliers(problem, result, scale, parameters),
            iterations=result.iterations,
            solve_s=time.perf_counter() - started,
        )

    def _build(
        self, data: Array, b: Array, settings: clarabel.DefaultSettings
    ) -> clarabel.DefaultSolver:
        A = self._pattern.copy()
        A.data[:] = data
        P = sp.csc_matrix((self.form.columns, self.form.columns))
        q = np.zeros(self.form.columns)
        q[self.form.aux_column] = 1.0
        return clarabel.DefaultSolver(P, q, A, b, self.form.clarabel_cones, settings)


def _unpack(
    form: ConicForm, problem: Problem, z: list[float], scale: Array | float, s: float
) -> Multipliers:
    return form.multipliers(problem, np.array(z) * scale, s)
