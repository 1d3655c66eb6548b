"""The CVXPY reference: the paper's variable counts, statuses, and a balance of its own."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import Objective
from fulcrum.synthesis.reference import ReferenceInfeasibleError, solve_reference
from tests.helpers.problems import arms, box, cylinder


@pytest.mark.parametrize(
    ("problem", "variables"),
    [(cylinder(30.0), 11), (box(30.0), 14), (box(30.0, joints=arms()), 28)],
)
def test_variable_count_is_the_paper_s(problem, variables):
    assert solve_reference(problem).variables == variables


@pytest.mark.parametrize("objective", [o for o in Objective if o is not Objective.FRICTION_MARGIN])
def test_reference_satisfies_equilibrium_and_torques_by_the_problem_s_own_maps(objective):
    problem = box(30.0, joints=arms(), objective=objective)
    solution = solve_reference(problem)
    balance = np.einsum("mkj,mj->k", problem.G, solution.w_OC_C) + problem.w_ext_O
    # The reference's feasibility tolerance of 1e-10 is relative to forces of some 30 N.
    assert np.abs(balance).max() < 1e-7
    assert np.abs(problem.torque(solution.w_OC_C) - solution.tau).max() < 1e-7


def test_lift_off_within_the_grip_limit_is_infeasible():
    with pytest.raises(ReferenceInfeasibleError):
        solve_reference(cylinder(0.0, environment=False))


def test_infeasible_margin_is_infeasible():
    problem = replace(cylinder(88.0), objective=Objective.FRICTION_MARGIN)
    with pytest.raises(ReferenceInfeasibleError):
        solve_reference(problem)


def test_package_does_not_import_the_reference():
    code = "import fulcrum.synthesis, sys; sys.exit('cvxpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
