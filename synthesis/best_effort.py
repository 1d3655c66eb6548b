r"""Forces for an infeasible problem: within all limits, as near to equilibrium as they get.

.. math::

    \text{minimise}\quad \left\| D (G F + w_{ext}) \right\|_2 + \epsilon \max F_n
    \quad\text{subject to (5), (6), (7), (15), (16)}

with D dividing moments by the contacts' largest distance from the point B that they are about, so
that force and moment count alike, and a small weight on the grip that picks the smallest of equal
forces.
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
from fulcrum.synthesis.solver import SOLVED, fallback_settings, solver_settings

_GRIP_WEIGHT = 1e-4


@dataclass(frozen=True, eq=False)
class BestEffort:
    """Forces that keep every limit but not the balance.

    Attributes:
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,).
        imbalance: What is left of (12), with moments about B, in the object's axes [N, N·m], (6,).
    """

    w_OC_C: Array
    tau: Array
    imbalance: Array


def best_effort(problem: Problem) -> BestEffort:
    """Solves the relaxed problem; its objective is replaced.

    Raises:
        InfeasibleError: The limits contradict each other even without equilibrium.
        SolverError: The solver gave neither forces nor a proof.
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
    program = (
        sp.csc_matrix((len(q), len(q))),
        q,
        sp.csc_matrix(np.vstack([cone, rest])),
        np.concatenate([[0.0], weights * b[balance], b[balance.stop :]]),
        [clarabel.SecondOrderConeT(7), *form.clarabel_cones[1:]],
    )
    for settings in (solver_settings(), *fallback_settings()):
        result = clarabel.DefaultSolver(*program, settings).solve()
        if str(result.status) in (*SOLVED, "PrimalInfeasible"):
            break
    if str(result.status) == "PrimalInfeasible":
        z = np.array(result.z)
        ray = form.multipliers(problem, np.concatenate([weights * z[1:7], z[7:]]))
        raise InfeasibleError(certificate(problem, ray))
    if str(result.status) not in SOLVED:
        raise SolverError(str(result.status))
    w_OC_C = form.wrenches(problem, np.array(result.x)[:-1])
    return BestEffort(
        w_OC_C=w_OC_C,
        tau=problem.torque(w_OC_C),
        imbalance=np.einsum("mkj,mj->k", problem.G, w_OC_C) + problem.w_ext_B,
    )
