r"""The range of a factor in the right-hand side of (17) for which forces exist.

Weight, torque limits and grip limits appear only in the right-hand side of the conic form of
:mod:`synthesis.conic`. With a factor k on any of them it is :math:`b_0 + k\, b_1`. The feasible
factors are an interval, whose ends are the optima of two second-order cone programs:

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
from fulcrum.synthesis.solver import SOLVED, attempts

# Smaller factors are zero to the solver.
_NO_FACTOR = 1e-8


class EmptyRangeError(Exception):
    """No factor is feasible."""


def factor_range(at: Callable[[float], Problem]) -> tuple[float, float]:
    """Return the least and the largest feasible factor >= 0; the largest may be infinite.

    Args:
        at: Function that returns the problem at a factor. All problems have one structure, and
            their right-hand sides are affine in the factor.

    Raises:
        EmptyRangeError: No factor is feasible.
        SolverError: The solver stopped without an answer.
    """
    problem, double = at(1.0), at(2.0)
    form = ConicForm(problem)
    A, b_1 = form.matrices(problem)
    slope = form.matrices(double)[1] * double.unit / problem.unit - b_1
    b_0 = b_1 - slope
    A[:, form.aux_column] = -slope
    scale = form.row_scale(np.maximum(np.abs(b_0), np.abs(slope)))
    A, b_0 = A * scale[:, None], b_0 * scale
    # A row that keeps the factor >= 0 replaces the rows of the objective.
    positive = np.zeros((1, form.columns))
    positive[0, form.aux_column] = -1.0
    balance, bounds, cones = form.equilibrium_rows, form.bound_rows, form.cone_rows
    A = np.vstack([A[balance], positive, A[bounds], A[cones]])
    b = np.concatenate([b_0[balance], [0.0], b_0[bounds], b_0[cones]])
    kinds = [
        clarabel.ZeroConeT(6),
        clarabel.NonnegativeConeT(1 + bounds.stop - bounds.start),
        *(clarabel.SecondOrderConeT(width) for _, width in form.cones),
    ]

    def extreme(sign: float) -> float:
        q = np.zeros(form.columns)
        q[-1] = sign
        status = ""
        for status, result in attempts(q, sp.csc_matrix(A), b, kinds):
            if status in SOLVED:
                factor = float(result.x[-1])
                return factor if factor > _NO_FACTOR else 0.0
            if status == "PrimalInfeasible":
                raise EmptyRangeError
            if status == "DualInfeasible":
                return math.inf
        raise SolverError(status)

    return extreme(1.0), extreme(-1.0)
