r"""Forces for an infeasible problem: within all limits, as close to equilibrium as possible.

.. math::

    \text{minimise}\quad \left\| D (G F + w_{ext}) \right\|_2 + \epsilon \max F_n
    \quad\text{subject to (5), (6), (7), (15), (16)}

D divides moments by the contacts' largest distance from their reference point B, so that force and
moment count alike. The small weight on the grip selects the smallest of equally good forces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import clarabel
import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.conic import ConicForm
from fulcrum.synthesis.errors import SolverError
from fulcrum.synthesis.problem import Objective, Problem
from fulcrum.synthesis.solution import InfeasibleError, certificate
from fulcrum.synthesis.solver import SOLVED, attempts

_GRIP_WEIGHT = 1e-4


@dataclass(frozen=True, eq=False)
class BestEffort:
    """Forces that satisfy every limit, but not equilibrium.

    Attributes:
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,).
        imbalance: Residual of (12) in the object's axes, moments about B [N, N·m], (6,).
    """

    w_OC_C: Array
    tau: Array
    imbalance: Array


def best_effort(problem: Problem) -> BestEffort:
    """Return the forces closest to equilibrium; the problem's objective is not used.

    Raises:
        InfeasibleError: The limits contradict each other even without equilibrium.
        SolverError: The solver found neither forces nor a proof.
    """
    problem = replace(problem, objective=Objective.MAX_NORMAL_FORCE)
    form = ConicForm(problem)
    A, b = form.matrices(problem)
    length = max(float(np.linalg.norm(problem.p_OC_O - problem.p_OB_O, axis=1).max()), 1e-3)
    weights = np.repeat([1.0, 1.0 / length], 3)
    # The equations G F + w = 0 become a cone (t; D (G F + w)), with t as a further column.
    balance = form.equilibrium_rows
    cone = np.zeros((7, form.columns + 1))
    cone[0, -1] = -1.0
    cone[1:, :-1] = weights[:, None] * A[balance]
    rest = np.column_stack([A[balance.stop :], np.zeros(form.rows - balance.stop)])
    q = np.zeros(form.columns + 1)
    q[form.aux_column], q[-1] = _GRIP_WEIGHT, 1.0
    right = np.concatenate([[0.0], weights * b[balance], b[balance.stop :]])
    cones = [clarabel.SecondOrderConeT(7), *form.clarabel_cones[1:]]
    status = ""
    for status, result in attempts(q, sp.csc_matrix(np.vstack([cone, rest])), right, cones):
        if status == "PrimalInfeasible":
            z = np.array(result.z)
            ray = form.multipliers(problem, np.concatenate([weights * z[1:7], z[7:]]))
            raise InfeasibleError(certificate(problem, ray))
        if status in SOLVED:
            w_OC_C = form.wrenches(problem, np.array(result.x)[:-1])
            return BestEffort(w_OC_C, problem.torque(w_OC_C), problem.imbalance(w_OC_C))
    raise SolverError(status)
