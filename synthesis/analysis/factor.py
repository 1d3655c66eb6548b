r"""The range of a factor in the right-hand side of (17) for which forces exist.

Weight, torque limits and grip limits stand in the right-hand side of the conic form of
:mod:`synthesis.conic` alone, so that with a factor k on any of them it is
:math:`b_0 + k\, b_1`. The feasible factors are an interval; its ends are the optima of two
second-order cone programs:

.. math:: \min \pm k \quad \text{s.t.}\quad A x - k\, b_1 + s = b_0,\ s \in \mathcal{K},\ k \ge 0
"""

from __future__ import annotations

import math
from collections.abc import Callable

import clarabel
import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis import Problem, SolverError
from fulcrum.synthesis.conic import ConicForm
from fulcrum.synthesis.solver import SOLVED, fallback_settings, solver_settings

# Linear factors below this are zero to the solver.
_NO_FACTOR = 1e-8


class EmptyRangeError(Exception):
    """No factor at all is feasible; the caller knows which problem to have proven infeasible."""


def factor_range(at: Callable[[float], Problem]) -> tuple[float, float]:
    """The least and the largest feasible factor >= 0; the largest may be infinite.

    Args:
        at: Problems of one structure, whose right-hand sides are affine in the factor.

    Raises:
        EmptyRangeError: No factor is feasible.
        SolverError: The solver stopped without an answer.
    """
    program = _FactorProgram(at)
    return program.extreme(1.0), program.extreme(-1.0)


class _FactorProgram:
    """The conic form with the factor in the place of the objective's auxiliary variable."""

    def __init__(self, at: Callable[[float], Problem]) -> None:
        problem, double = at(1.0), at(2.0)
        form = ConicForm(problem)
        unit = form.force_unit(problem)
        A, b_1 = form.matrices(problem)
        slope = form.matrices(double)[1] * form.force_unit(double) / unit - b_1
        b_0 = b_1 - slope
        A[:, form.aux_column] = -slope
        scale = form.row_scale(np.maximum(np.abs(b_0), np.abs(slope)))
        A, b_0 = A * scale[:, None], b_0 * scale
        # The rows of the objective give way to one that keeps the factor >= 0.
        positive = np.zeros((1, form.columns))
        positive[0, form.aux_column] = -1.0
        balance, cones = form.equilibrium_rows, form.cone_rows
        bounds = slice(form.f_n_min_rows.start, form.tau_min_rows.stop)
        self._A = sp.csc_matrix(np.vstack([A[balance], positive, A[bounds], A[cones]]))
        self._b = np.concatenate([b_0[balance], [0.0], b_0[bounds], b_0[cones]])
        self._cones = [
            clarabel.ZeroConeT(6),
            clarabel.NonnegativeConeT(1 + bounds.stop - bounds.start),
            *(clarabel.SecondOrderConeT(width) for _, width in form.cones),
        ]

    def extreme(self, sign: float) -> float:
        """The least (sign 1) or largest (sign -1) feasible factor; infinite where there is none."""
        columns = self._A.shape[1]
        P, q = sp.csc_matrix((columns, columns)), np.zeros(columns)
        q[-1] = sign
        status = ""
        for settings in (solver_settings(), *fallback_settings()):
            solver = clarabel.DefaultSolver(P, q, self._A, self._b, self._cones, settings)
            result = solver.solve()
            status = str(result.status)
            if status in SOLVED:
                factor = float(result.x[-1])
                return factor if factor > _NO_FACTOR else 0.0
            match status:
                case "PrimalInfeasible":
                    raise EmptyRangeError
                case "DualInfeasible":
                    return math.inf
        raise SolverError(status)
