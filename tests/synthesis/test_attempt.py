"""Problems are attempted without torque limits: that counts only where it answers the problem."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import InfeasibleError, Objective, Synthesizer
from fulcrum.synthesis.friction_margin import AS_IT_STANDS
from fulcrum.synthesis.synthesizer import _REST
from tests.helpers.problems import arms, box, random_feasible, random_infeasible

OBJECTIVES = [o for o in Objective if o is not Objective.FRICTION_MARGIN]


def binding(objective):
    """A problem whose torque limits cut off the optimum found without them, and that optimum."""
    problem = box(30.0, joints=arms(), objective=objective)
    other = Objective.MAX_NORMAL_FORCE if objective.needs_joints else Objective.NORM_TORQUE
    free, held = (Synthesizer().solve(replace(problem, objective=o)) for o in (objective, other))
    worst = int(np.argmax(free.tau - held.tau))
    # Halfway between two feasible points is a third.
    limit = problem.joints.tau_max.copy()
    limit[worst] = (free.tau[worst] + held.tau[worst]) / 2.0
    return replace(problem, joints=replace(problem.joints, tau_max=limit)), free


def careful(problem):
    """The solution with all rows at once."""
    return Synthesizer()._solve(problem, AS_IT_STANDS)


# A torque utilisation below 1 keeps all limits.
@pytest.mark.parametrize(
    "objective", [o for o in OBJECTIVES if o is not Objective.MAX_TORQUE_UTILISATION]
)
def test_answer_that_breaks_a_torque_limit_is_not_taken(objective):
    problem, free = binding(objective)
    solution = Synthesizer().solve(problem)
    assert replace(free, problem=problem).residuals.primal > 1e-3
    # The solver's tolerance of 1e-9 of the load, 1e-8 at worst, on both sides.
    assert solution.residuals.primal < 1e-7 * problem.load
    assert solution.residuals.gap < 1e-7 * problem.load
    assert solution.residuals.dual < 1e-7
    assert solution.value > free.value - 1e-7 * problem.load


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("seed", range(15))
def test_attempt_gives_the_value_and_the_proof_of_all_rows(seed, objective):
    problem = random_feasible(seed, objective)
    found, expected = Synthesizer().solve(problem), careful(problem)
    size = max(problem.load, np.abs(expected.w_OC_C).max())
    # Both solve to 1e-9 of the load, 1e-8 at worst.
    unit = 1.0 if objective is Objective.MAX_TORQUE_UTILISATION else size
    assert abs(found.value - expected.value) <= 1e-7 * unit
    assert found.residuals.primal <= 1e-7 * size
    assert found.residuals.gap <= 1e-6 * unit
    assert found.residuals.dual <= 1e-6


@pytest.mark.parametrize("seed", range(30))
def test_verdict_of_an_attempt_is_proven_for_all_rows(seed):
    problem = random_infeasible(seed, Objective.MAX_NORMAL_FORCE)
    with pytest.raises(InfeasibleError) as error:
        Synthesizer().solve(problem)
    assert error.value.certificate.problem is problem
    # No contact here carries more than a hundred times the load.
    assert error.value.certificate.proves(100.0 * problem.load)


def test_attempts_rest_after_a_futile_one_and_come_back():
    problem, _ = binding(Objective.MAX_NORMAL_FORCE)
    wide = np.full(len(problem.joints.names), 1e3)
    roomy = replace(problem, joints=replace(problem.joints, tau_min=-wide, tau_max=wide))
    synthesizer = Synthesizer()
    assert synthesizer.solve(roomy).multipliers.tau_max.max() == 0.0
    assert synthesizer.solve(problem).multipliers.tau_max.min() > 0.0
    # An interior point solver leaves no multiplier at zero, unless its row was left out.
    resting = [synthesizer.solve(roomy).multipliers.tau_max.max() > 0.0 for _ in range(_REST + 1)]
    assert resting == [True] * _REST + [False]
