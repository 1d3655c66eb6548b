"""The friction margin and the duals of the synthesizer's solutions."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import (
    Contact,
    ContactModel,
    Objective,
    Problem,
    Role,
    Synthesizer,
    UnboundedError,
)
from fulcrum.synthesis.contact import utilisation
from tests.helpers.problems import (
    arms,
    box,
    random_feasible,
)

# Both solve to 1e-8 at worst, relative to forces that may be a hundred times the value.
AGREEMENT = 1e-6
SYNTHESIZER = Synthesizer()


def load(problem):
    """The scale of the forces in a problem [N, N·m]."""
    return max(np.abs(problem.w_ext_O).max(), *(c.f_n_min for c in problem.contacts))


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
