"""Problems are attempted without torque limits: that counts only where it answers the problem."""

from dataclasses import replace

import numpy as np
import pytest

from synthesis import InfeasibleError, Objective, Synthesizer
from synthesis.synthesizer import _AS_IT_STANDS, _REST
from tests.problems import arms, box, random_feasible, random_infeasible

OBJECTIVES = [o for o in Objective if o is not Objective.FRICTION_MARGIN]


def binding(objective):
    """A problem whose torque limits cut off the optimum without them, and that optimum."""
    problem = box(30.0, joints=arms(), objective=objective)
    free = Synthesizer().solve(problem)
    worst = int(np.argmax(np.abs(free.tau)))
    limit = problem.joints.tau_max.copy()
    limit[worst] = 0.95 * abs(free.tau[worst])
    return replace(problem, joints=replace(problem.joints, tau_min=-limit, tau_max=limit)), free


def careful(problem):
    """The solution with all rows at once."""
    return Synthesizer()._solve(problem, _AS_IT_STANDS)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_answer_that_breaks_a_torque_limit_is_not_taken(objective):
    problem, free = binding(objective)
    solution = Synthesizer().solve(problem)
    # The free optimum breaks the limit by 5 %; what is returned keeps it to the solver's tolerance.
    assert replace(free, problem=problem).residuals.primal > 0.01 * np.abs(free.tau).max()
    assert solution.residuals.primal < 1e-7 * problem.load
    assert max(solution.multipliers.tau_max.max(), solution.multipliers.tau_min.max()) > 1e-6


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
