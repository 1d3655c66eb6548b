"""Solutions and certificates prove themselves, and notice every tampering."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import InfeasibleError, Objective, Synthesizer
from fulcrum.synthesis.solution import Certificate, certificate, shrink_cones
from tests.helpers.problems import arms, box, random_feasible, random_infeasible

SYNTHESIZER = Synthesizer()
# Larger than any honest residual by an order of magnitude, smaller than any tampering by four.
NOTICED = 1e-3


def solve(objective=Objective.MAX_TORQUE, tilt=30.0):
    return SYNTHESIZER.solve(box(tilt, joints=arms(), objective=objective))


def infeasible(seed):
    with pytest.raises(InfeasibleError) as error:
        SYNTHESIZER.solve(random_infeasible(seed))
    return error.value.certificate


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("tilt", [0.0, 45.0, 80.0])
def test_honest_solution_has_small_residuals(objective, tilt):
    residuals = solve(objective, tilt).residuals
    # The solver's accepted tolerance of 1e-8 on forces, torques and multipliers up to 50.
    assert max(residuals.primal, residuals.dual, residuals.gap) < 1e-6


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("seed", range(10))
def test_honest_random_solution_has_small_residuals(objective, seed):
    residuals = SYNTHESIZER.solve(random_feasible(seed, objective)).residuals
    # As above, for forces up to 1000 N.
    assert max(residuals.primal, residuals.dual, residuals.gap) < 1e-5


def test_scaled_force_breaks_equilibrium():
    solution = solve()
    w = solution.w_OC_C.copy()
    w[2] *= 1.1
    assert replace(solution, w_OC_C=w).residuals.primal > NOTICED


def test_force_outside_its_cone_is_noticed_even_in_equilibrium():
    # Pressing less with both hands keeps the balance of the symmetric pair, not their cones.
    solution = solve()
    w = solution.w_OC_C.copy()
    w[:2, 2] -= 1.0
    problem = solution.problem
    assert np.abs(np.einsum("mkj,mj->k", problem.G, w) + problem.w_ext_O).max() < 1e-6
    tampered = replace(solution, w_OC_C=w, tau=problem.torque(w))
    assert tampered.residuals.primal > NOTICED


def test_untransmitted_component_is_noticed():
    solution = solve()
    w = solution.w_OC_C.copy()
    w[2, 5] += 0.1
    assert replace(solution, w_OC_C=w).residuals.primal > NOTICED


def test_swapped_torques_are_noticed():
    solution = solve()
    assert replace(solution, tau=solution.tau[::-1]).residuals.primal > NOTICED


def test_torque_beyond_its_limit_is_noticed():
    solution = solve()
    tight = replace(solution.problem.joints, tau_max=solution.tau - 0.01)
    problem = replace(solution.problem, joints=replace(tight, tau_min=tight.tau_max - 100.0))
    assert replace(solution, problem=problem).residuals.primal > NOTICED


@pytest.mark.parametrize("bound", [{"f_n_min": 100.0}, {"f_n_max": 1.0}])
def test_normal_force_beyond_its_bound_is_noticed(bound):
    solution = solve()
    contacts = (replace(solution.problem.contacts[0], **bound), *solution.problem.contacts[1:])
    problem = replace(solution.problem, contacts=contacts)
    assert replace(solution, problem=problem).residuals.primal > NOTICED


def test_value_that_is_not_the_optimum_opens_the_gap():
    solution = solve()
    assert replace(solution, value=solution.value * 1.01).residuals.gap > NOTICED


@pytest.mark.parametrize("field", ["equilibrium", "cone", "gradient"])
def test_tampered_multipliers_break_stationarity(field):
    solution = solve()
    multipliers = replace(
        solution.multipliers, **{field: 1.1 * getattr(solution.multipliers, field)}
    )
    assert replace(solution, unpack=lambda: multipliers).residuals.dual > NOTICED


def test_multiplier_outside_its_dual_cone_is_noticed():
    solution = solve()
    cone = solution.multipliers.cone.copy()
    cone[0, 2] -= 1.0
    tampered = replace(solution.multipliers, cone=cone)
    assert tampered.cone_violation(solution.problem) > NOTICED


@pytest.mark.parametrize("seed", range(12))
def test_certificate_proves_and_names_what_binds(seed):
    proof = infeasible(seed)
    assert proof.value == pytest.approx(1.0)
    assert proof.proves(1e4)
    assert len(proof.heaviest(3)) == 3


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("field", ["equilibrium", "cone"])
def test_tampered_certificate_does_not_prove(seed, field):
    proof = infeasible(seed)
    rng = np.random.default_rng(seed)
    honest = getattr(proof.multipliers, field)
    # A tenth of the largest multiplier, in every direction, on every contact.
    noise = 0.1 * np.abs(honest).max() * rng.normal(size=honest.shape)
    if not np.abs(honest).max() > 0.0:
        pytest.skip("the proof does not rest on this multiplier")
    tampered = replace(proof.multipliers, **{field: honest + noise})
    assert not Certificate(proof.problem, tampered).proves(1e4)


@pytest.mark.parametrize("seed", range(12))
def test_negated_certificate_does_not_prove(seed):
    proof = infeasible(seed)
    honest = proof.multipliers
    negated = replace(honest, equilibrium=-honest.equilibrium, cone=-honest.cone)
    assert not Certificate(proof.problem, negated).proves(1e4)


@pytest.mark.parametrize("seed", range(24))
def test_multipliers_of_a_feasible_problem_prove_nothing(seed):
    problem = random_feasible(seed)
    solution = SYNTHESIZER.solve(problem)
    size = float(np.abs(solution.w_OC_C).max())
    assert not certificate(problem, solution.multipliers).proves(size)


def test_certificate_of_a_grip_limit_proves_nothing_about_a_wider_one():
    def lift_off(f_n_max):
        problem = box(0.0, environment=False)
        return replace(
            problem, contacts=tuple(replace(c, f_n_max=f_n_max) for c in problem.contacts)
        )

    # Lift-off takes 101.1 N per hand.
    with pytest.raises(InfeasibleError) as error:
        SYNTHESIZER.solve(lift_off(80.0))
    proof = error.value.certificate
    assert proof.proves(1e3)
    assert not replace(proof, problem=lift_off(110.0)).proves(1e3)


def test_shrunk_cones_leave_frictionless_contacts_alone():
    problem = random_feasible(5, Objective.FRICTION_MARGIN)
    for before, after in zip(problem.contacts, shrink_cones(problem, 0.5).contacts, strict=True):
        assert after.scale[1:] == pytest.approx(0.5 * before.scale[1:], rel=1e-15)


def test_solution_gives_wrenches_by_contact_name():
    solution = solve()
    np.testing.assert_array_equal(solution.wrench("edge left"), solution.w_OC_C[2])
