r"""Solves contact force synthesis problems on Clarabel, with one prebuilt solver per structure.

Torque limits are most of the numbers in (17) and rarely bind. So a problem is first attempted
without them. The set without them is larger, and its optimum no worse: if that optimum satisfies
(16), it is optimal for (17), with multipliers of zero for (16). Multipliers that prove the relaxed
problem infeasible also prove (17) infeasible. The attempt is made without iterative refinement:
Clarabel stops by residuals that it computes from the data, whatever the accuracy of its steps. The
result is used if it is ``Solved`` to the full tolerance, balances the object and satisfies (16), or
if its proof of infeasibility holds. Otherwise the whole problem is solved, with refinement. The
friction margin squeezes until a limit binds, so it is not attempted; see
:mod:`synthesis.friction_margin`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable
from functools import partial
from itertools import chain
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
# Largest accepted imbalance; the solver's tolerance is relative to its largest number, which may be
# an absurd bound.
_WORST_IMBALANCE = 1e-6
# The same for an attempt, which is not the last chance.
_IMBALANCE = 1e-8
# An attempt's proof of infeasibility must hold for forces up to this many times the load [-].
_FARTHEST = 1e4
# Number of problems of a structure that are solved with all rows after an attempt has failed:
# torque limits that bind once bind again, and a futile attempt takes a third more time.
_REST = 16


class Synthesizer:
    """Solver of problems that keeps a prebuilt solver for each problem structure.

    Example:
        >>> solution = Synthesizer().solve(problem)
        >>> solution.wrench("left")
    """

    def __init__(self) -> None:
        self._programs: dict[tuple[Hashable, bool], _Program] = {}

    def solve(self, problem: Problem) -> Solution:
        """Return the optimal solution of (17).

        Raises:
            InfeasibleError: No forces satisfy the constraints; carries the certificate.
            UnboundedError: The objective improves as long as forces grow.
            SolverError: The solver found neither a solution nor a proof.
        """
        if problem.objective is Objective.FRICTION_MARGIN:
            return largest_margin(self._solve, problem)
        quick = self._program(problem, careful=False)
        if quick.rest:
            quick.rest -= 1
        elif solution := quick.attempt(problem):
            return solution
        else:
            quick.rest = _REST
        return self._solve(problem, AS_IT_STANDS)

    def _solve(self, problem: Problem, parameters: Parameters) -> Solution:
        """Solve all of (17) once; for the friction margin the value is lambda."""
        return self._program(problem, careful=True).solve(problem, parameters)

    def _program(self, problem: Problem, careful: bool) -> _Program:
        key = structure(problem, torque_limits=careful), careful
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = _Program(problem, careful)
        return program


class _Program:
    """A Clarabel solver for one structure, with its sparsity.

    Attributes:
        rest: Number of problems still to be solved by the careful program instead.
    """

    def __init__(self, problem: Problem, careful: bool) -> None:
        """Build the solver.

        Args:
            problem: Any problem of the structure.
            careful: True for all rows and iterative refinement, as :meth:`solve` needs; False for
                no torque limits and no refinement, as :meth:`attempt` needs.
        """
        self.rest = 0
        self._form = ConicForm(problem, torque_limits=careful)
        self._pattern = sp.csc_matrix(self._form.sparsity(problem), dtype=np.float64)
        columns = np.repeat(np.arange(self._form.columns), np.diff(self._pattern.indptr))
        self._entries = self._pattern.indices * self._form.columns + columns
        settings = solver_settings()
        settings.iterative_refinement_enable = careful
        self._solver = self._build(*self._form.matrices(problem), settings)

    def attempt(self, problem: Problem) -> Solution | None:
        """Solve without the torque limits; return None if that does not answer (17)."""
        started = time.perf_counter()
        A, b, scale = self._scaled(problem, AS_IT_STANDS)
        result = self._update_and_solve(A, b)
        status = str(result.status)
        unpack = self._unpack(problem, result, scale, 1.0)
        if status == "PrimalInfeasible":
            proof = certificate(problem, unpack())
            if proof.proves(_FARTHEST * problem.unit):
                raise InfeasibleError(proof)
        if status != "Solved" or not self._balances(result, A, b, _IMBALANCE):
            return None
        solution = self._solution(problem, result, unpack, started)
        return solution if _within_limits(problem.joints, solution.tau) else None

    def solve(self, problem: Problem, parameters: Parameters) -> Solution:
        """Solve all of (17), with differently set solvers where the prebuilt one stalls."""
        started = time.perf_counter()
        A, b, scale = self._scaled(problem, parameters)
        result = self._decided(A, b)
        unpack = self._unpack(problem, result, scale, parameters.s)
        match str(result.status):
            case "PrimalInfeasible":
                raise InfeasibleError(certificate(problem, unpack()))
            case "DualInfeasible":
                raise UnboundedError(problem.objective)
        return self._solution(problem, result, unpack, started)

    def _scaled(
        self, problem: Problem, parameters: Parameters
    ) -> tuple[Array, Array, Array | float]:
        A, b = self._form.matrices(problem, parameters.s, parameters.d)
        if not self._form.has_loose_limits(problem):
            return A, b, 1.0
        scale = self._form.row_scale(b)
        return A * scale[:, None], b * scale, scale

    def _update_and_solve(self, A: Array, b: Array) -> clarabel.DefaultSolution:
        # Clarabel reads lists three times as fast as arrays.
        self._solver.update(A=A.take(self._entries).tolist(), b=b.tolist())
        return self._solver.solve()

    def _decided(self, A: Array, b: Array) -> clarabel.DefaultSolution:
        """Return the first result that is a proof, or balances the object."""
        careful = (self._build(A, b, settings).solve() for settings in fallback_settings())
        for result in chain([self._update_and_solve(A, b)], careful):
            status = str(result.status)
            balanced = status in SOLVED and self._balances(result, A, b, _WORST_IMBALANCE)
            if balanced or status in _PROVEN:
                return result
        raise SolverError(status)

    def _balances(
        self, result: clarabel.DefaultSolution, A: Array, b: Array, tolerance: float
    ) -> bool:
        x, rows = np.array(result.x), self._form.equilibrium_rows
        imbalance, forces = A[rows].dot(x) - b[rows], x[: self._form.aux_column]
        size = max(1.0, math.sqrt(forces.dot(forces)))
        return math.sqrt(imbalance.dot(imbalance)) <= tolerance * size

    def _unpack(
        self,
        problem: Problem,
        result: clarabel.DefaultSolution,
        scale: Array | float,
        utilisation: float,
    ) -> Callable[[], Multipliers]:
        return partial(_multipliers, self._form, problem, result.z, scale, utilisation)

    def _solution(
        self,
        problem: Problem,
        result: clarabel.DefaultSolution,
        unpack: Callable[[], Multipliers],
        started: float,
    ) -> Solution:
        x = np.array(result.x)
        w_OC_C = self._form.wrenches(problem, x)
        return Solution(
            problem=problem,
            value=self._form.value(problem, x),
            w_OC_C=w_OC_C,
            tau=problem.torque(w_OC_C),
            unpack=unpack,
            iterations=result.iterations,
            solve_s=time.perf_counter() - started,
        )

    def _build(
        self, A: Array, b: Array, settings: clarabel.DefaultSettings
    ) -> clarabel.DefaultSolver:
        sparse = self._pattern.copy()
        sparse.data[:] = A.take(self._entries)
        P = sp.csc_matrix((self._form.columns, self._form.columns))
        q = np.zeros(self._form.columns)
        q[self._form.aux_column] = 1.0
        return clarabel.DefaultSolver(P, q, sparse, b, self._form.clarabel_cones, settings)


def _within_limits(joints: Joints | None, tau: Array) -> bool:
    if joints is None:
        return True
    given = tau.tolist()  # for so few numbers, lists are faster than arrays
    low, high = joints.tau_min.tolist(), joints.tau_max.tolist()
    return all(map(le, low, given)) and all(map(le, given, high))


def _multipliers(
    form: ConicForm, problem: Problem, z: list[float], scale: Array | float, utilisation: float
) -> Multipliers:
    return form.multipliers(problem, np.array(z) * scale, utilisation)
