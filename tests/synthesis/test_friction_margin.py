"""The friction margin and the duals of the synthesizer's solutions."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import (
    Contact,
    ContactModel,
    InfeasibleError,
    Objective,
    Problem,
    Role,
    Synthesizer,
    UnboundedError,
)
from fulcrum.synthesis.contact import utilisation
from tests.helpers.margins import least_utilisation, margins, palms, slope, squeezable
from tests.helpers.problems import (
    arms,
    box,
    load,
    random_feasible,
)

SYNTHESIZER = Synthesizer()


# --- the friction margin ---


@pytest.mark.parametrize("seed", range(12))
def test_friction_margin_is_its_forces_utilisation_and_no_sample_is_better(seed):
    problem = random_feasible(seed, Objective.FRICTION_MARGIN)
    solution = SYNTHESIZER.solve(problem)
    assert solution.utilisation.max() == pytest.approx(solution.value, rel=1e-9)
    columns = [6 * i + k for i, c in enumerate(problem.contacts) for k in c.model.components]
    G = problem.G.transpose(1, 0, 2).reshape(6, -1)[:, columns]
    null = np.linalg.svd(G)[2][np.linalg.matrix_rank(G) :]
    rng = np.random.default_rng(seed)
    size = np.abs(solution.w_OC_C).max()
    for step in size * 10.0 ** rng.uniform(-4.0, 0.0, size=200 if len(null) else 0):
        flat = solution.w_OC_C.ravel().copy()
        flat[columns] += step * rng.normal(size=len(null)) @ null
        w = flat.reshape(-1, 6)
        sample = replace(solution, w_OC_C=w, tau=problem.torque(w))
        if sample.residuals.primal < 1e-9 * size:
            assert utilisation(problem.contacts, w).max() > solution.value - 1e-8


def test_friction_margin_uses_less_friction_than_the_smallest_grip():
    problem = box(30.0, joints=arms())
    grip = SYNTHESIZER.solve(problem)
    margin = SYNTHESIZER.solve(replace(problem, objective=Objective.FRICTION_MARGIN))
    # The smallest grip lies on its cones.
    assert grip.utilisation.max() == pytest.approx(1.0, abs=1e-6)
    assert margin.value < 0.97


def test_forced_unloaded_contact_does_not_spoil_the_margin_of_the_others():
    # Nothing can press against the wall, so its contact is unloaded in every balance.
    def contact(name, role):
        return Contact(name, role, ContactModel.PCWF, mu=0.5, f_n_max=100.0)

    problem = Problem(
        contacts=(contact("palm", Role.HAND), contact("ceiling", Role.ENVIRONMENT)),
        R_OC=np.array([np.eye(3), np.diag([1.0, -1.0, -1.0])]),
        p_OC_O=np.array([[0.0, 0.0, -0.1], [0.3, 0.0, 0.1]]),
        w_ext_O=np.array([2.0, 0.0, -10.0, 0.0, -0.2, 0.0]),
        objective=Objective.FRICTION_MARGIN,
    )
    # The palm carries 2 N along a cone of 0.5 * 10 N.
    assert SYNTHESIZER.solve(problem).value == pytest.approx(0.4, rel=1e-6)


@pytest.mark.parametrize("seed", [84, 179, 192])
def test_frictionless_balance_has_a_margin_of_zero_and_no_pulling_contact(seed):
    # At a utilisation of zero the cones alone would let the normal forces pull.
    problem = random_feasible(seed, Objective.FRICTION_MARGIN)
    solution = SYNTHESIZER.solve(problem)
    assert solution.value < 1e-7
    assert solution.w_OC_C[:, 2].min() > -1e-7
    assert solution.residuals.primal < 1e-7 * load(problem)


def test_unlimited_squeeze_makes_the_margin_unbounded():
    problem = replace(box(0.0, environment=False), objective=Objective.FRICTION_MARGIN)
    with pytest.raises(UnboundedError, match="f_n_max"):
        SYNTHESIZER.solve(problem)


# --- squeezes without limit: where finite forces attain the optimum, and where none do ---


@pytest.mark.parametrize("seed", range(300))
def test_the_margin_of_unlimited_squeezes_is_the_reference_s(seed):
    problem = squeezable(seed)
    expected, solution = margins()[str(seed)], SYNTHESIZER.solve(problem)
    # The reference's last interval is 1e-9 wide, but its proofs next to the optimum are worth 1e-7.
    assert solution.value == pytest.approx(expected, abs=1e-6)
    assert solution.utilisation[forces(solution) > 1e-5].max(initial=0.0) < expected + 1e-6
    residuals = solution.residuals
    assert residuals.primal < 1e-6 * problem.load
    assert residuals.dual < 1e-5
    assert residuals.gap < 1e-6


@pytest.mark.parametrize("seed", [5, 15, 20, 262, 299])
def test_the_stored_margins_are_what_the_reference_finds(seed):
    expected = least_utilisation(squeezable(seed))
    assert margins()[str(seed)] == pytest.approx(expected, abs=1e-6)


def test_a_hand_that_is_better_unloaded_is_unloaded():
    solution = SYNTHESIZER.solve(slope(-50.0))
    # On the slope alone: tan 10 deg of friction at every point. Any push down the slope adds to it.
    assert solution.value == pytest.approx(np.tan(np.radians(10.0)), abs=1e-6)
    assert forces(solution)[0] < 1e-6


def test_a_hand_that_pushes_up_the_slope_needs_no_friction_at_all():
    solution = SYNTHESIZER.solve(slope(50.0))
    assert solution.value == pytest.approx(0.0, abs=1e-6)
    assert solution.residuals.primal < 1e-6 * 20.0
    assert forces(solution).max() < 3.0


def test_a_margin_that_no_finite_forces_attain_says_what_it_tends_to():
    # Palms that open downwards by an angle lift the box by friction alone: half the weight each
    # takes a utilisation of (tan(angle) + W / (2 f_n cos(angle))) / mu.
    for angle in (0.05, 0.0):
        with pytest.raises(UnboundedError) as caught:
            SYNTHESIZER.solve(palms(angle))
        # At 1e4 times the load the search ends: W / (2 f_n mu) is 1e-4.
        assert caught.value.limit == pytest.approx(np.tan(angle) / 0.5, abs=2e-4)


def test_a_limit_of_force_makes_such_a_margin_attained():
    problem = palms(0.05)
    limited = tuple(replace(c, f_n_max=100.0) for c in problem.contacts)
    expected = (np.tan(0.05) + 20.0 / (200.0 * np.cos(0.05))) / 0.5
    value = SYNTHESIZER.solve(replace(problem, contacts=limited)).value
    assert value == pytest.approx(expected, abs=1e-6)


def test_palms_that_open_upwards_need_no_friction():
    assert SYNTHESIZER.solve(palms(-0.3)).value == pytest.approx(0.0, abs=1e-6)


def test_without_any_forces_the_margin_is_infeasible_however_far_one_may_squeeze():
    # Nothing resists a turn about the line between two points.
    problem = replace(palms(0.05), w_ext_O=10.0 * np.eye(6)[3])
    with pytest.raises(InfeasibleError) as caught:
        SYNTHESIZER.solve(problem)
    assert caught.value.certificate.residual < 1e-6


def forces(solution):
    """Normal forces over the load [-], (m,)."""
    return solution.w_OC_C[:, 2] / solution.problem.load


# --- duals ---


@pytest.mark.parametrize("objective", [o for o in Objective if o is not Objective.FRICTION_MARGIN])
def test_equilibrium_multipliers_are_the_value_s_gradient_in_the_load(objective):
    problem = box(30.0, joints=arms(), objective=objective)
    # Off the symmetry plane, where the optimum is smooth in the load.
    problem = replace(
        problem, w_ext_O=problem.w_ext_O + np.array([0.3, 0.2, 0.1, 0.02, 0.03, 0.01])
    )
    nu = SYNTHESIZER.solve(problem).multipliers.equilibrium
    # Central differences: curvature error 1e-6, solver error 1e-8 over the step of 1e-3.
    step = 1e-3
    gradient = []
    for direction in step * np.eye(6):
        above, below = (
            SYNTHESIZER.solve(replace(problem, w_ext_O=problem.w_ext_O + d)).value
            for d in (direction, -direction)
        )
        gradient.append((above - below) / (2.0 * step))
    np.testing.assert_allclose(gradient, nu, atol=1e-4 * np.abs(nu).max())
