"""Facts about forces for problems that have no solution."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import InfeasibleError, Objective, Synthesizer
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.best_effort import best_effort
from tests.helpers.problems import box

SYNTHESIZER = Synthesizer()


def limited_lift(f_n_max: float):
    """The box of Table II lifted off, with a grip limit [N]; it takes 101.1 N."""
    problem = box(0.0, environment=False)
    contacts = tuple(replace(c, f_n_max=f_n_max) for c in problem.contacts)
    return replace(problem, contacts=contacts)


def test_a_feasible_problem_is_balanced_with_the_least_grip():
    problem = box(30.0)
    effort, solution = best_effort(problem), SYNTHESIZER.solve(problem)
    # The balance is weighed 1e4 times the grip, and holds to the solver's tolerance.
    assert np.abs(effort.imbalance).max() < 1e-5
    assert effort.w_OC_C[:2, N].max() == pytest.approx(solution.value, rel=1e-4)


def test_an_infeasible_problem_is_balanced_as_far_as_its_limits_allow():
    problem = limited_lift(60.0)
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(problem)
    effort = best_effort(problem)
    # Both hands at their limit carry at most 2 x 0.1 x 60 N of the 20 N, less what torsion takes.
    assert effort.w_OC_C[:, N] == pytest.approx([60.0, 60.0], abs=1e-4)
    carried = 20.0 - np.linalg.norm(effort.imbalance[:3])
    assert 11.0 < carried <= 12.0 + 1e-6


def test_more_grip_leaves_less_imbalance():
    left = [np.linalg.norm(best_effort(limited_lift(f)).imbalance[:3]) for f in (40, 60, 80, 102)]
    assert left == sorted(left, reverse=True)
    # 101.1 N is enough: nothing is left, which shows that the measure can be zero.
    assert left[-1] < 1e-5 < left[-2]


def test_the_objective_asked_for_does_not_matter():
    problem = limited_lift(60.0)
    other = best_effort(replace(problem, objective=Objective.NORM_NORMAL_FORCE))
    # The same problem is solved: equal to the last bit.
    np.testing.assert_array_equal(best_effort(problem).w_OC_C, other.w_OC_C)


def test_limits_that_contradict_each_other_are_infeasible_even_so():
    from tests.helpers.problems import arms

    joints = arms()
    # A preload of 50 N asks for torques, and next to none is left beside gravity's.
    tight = replace(joints, tau_min=joints.tau_g - 1e-3, tau_max=joints.tau_g + 1e-3)
    problem = box(0.0, joints=tight)
    contacts = tuple(replace(c, f_n_min=50.0) for c in problem.contacts[:2])
    problem = replace(problem, contacts=(*contacts, *problem.contacts[2:]))
    with pytest.raises(InfeasibleError):
        best_effort(problem)
