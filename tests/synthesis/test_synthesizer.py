"""The synthesizer against the paper's numbers, the CVXPY reference and facts of optimality."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fulcrum.synthesis import (
    Contact,
    ContactModel,
    InfeasibleError,
    Objective,
    Problem,
    Role,
    Synthesizer,
)
from fulcrum.synthesis.reference import ReferenceInfeasibleError, solve_reference
from tests.helpers.problems import (
    BOX_BALANCE_DEG,
    BOX_WEIGHT,
    arms,
    box,
    cylinder,
    load,
    random_feasible,
    random_infeasible,
)

# Both solve to 1e-8 at worst, relative to forces that may be a hundred times the value.
AGREEMENT = 1e-6
SYNTHESIZER = Synthesizer()


def assert_agrees_with_reference(problem):
    value = SYNTHESIZER.solve(problem).value
    # A value far below the load (or a margin near zero) is compared on the scale of the load.
    floor = 1e-2 if problem.objective is Objective.FRICTION_MARGIN else 1e-3 * load(problem)
    expected = solve_reference(problem).value
    assert abs(value - expected) <= AGREEMENT * max(abs(expected), floor)


def scaled(problem, factor):
    """The same problem with all forces and torques multiplied by a factor."""
    joints = problem.joints
    if joints is not None:
        limits = ("tau_g", "tau_min", "tau_max")
        joints = replace(joints, **{f: getattr(joints, f) * factor for f in limits})
    contacts = tuple(
        replace(c, f_n_min=c.f_n_min * factor, f_n_max=c.f_n_max * factor) for c in problem.contacts
    )
    return replace(problem, contacts=contacts, w_ext_O=problem.w_ext_O * factor, joints=joints)


# --- the paper's numbers; 0.005 N is its last printed digit ---


def test_largest_box_grip_is_the_paper_s_27_22():
    assert SYNTHESIZER.solve(box(0.0, up=0.055)).value == pytest.approx(27.221, abs=0.005)


def test_largest_box_grip_with_hands_on_the_centre_line_is_27_245():
    assert SYNTHESIZER.solve(box(0.0)).value == pytest.approx(27.245, abs=0.005)


def test_box_grip_vanishes_where_the_centre_of_mass_stands_over_the_edge():
    tilts = np.arange(0.0, 90.5, 0.5)
    grips = [SYNTHESIZER.solve(box(tilt)).value for tilt in tilts]
    # Half a step of the grid.
    assert tilts[np.argmin(grips)] == pytest.approx(BOX_BALANCE_DEG, abs=0.25)
    assert max(grips) == grips[0]
    # Only the solver's tolerance of 1e-9 of 20 N is left.
    assert SYNTHESIZER.solve(box(BOX_BALANCE_DEG)).value < 1e-6
    assert grips[-1] == pytest.approx(9.08, abs=0.005)


def test_box_lift_off_takes_more_than_the_frictional_minimum():
    grip = SYNTHESIZER.solve(box(0.0, environment=False)).value
    assert grip == pytest.approx(101.1, abs=0.1)
    assert grip > BOX_WEIGHT / (2 * 0.1)


def test_box_lift_off_within_torque_limits_is_infeasible():
    weak = replace(arms(), tau_min=np.full(14, -15.0), tau_max=np.full(14, 15.0))
    problem = box(0.0, environment=False, joints=replace(weak, tau_g=np.zeros(14)))
    with pytest.raises(InfeasibleError) as error:
        SYNTHESIZER.solve(problem)
    assert error.value.certificate.proves(1e4)


def test_cylinder_is_feasible_up_to_85_degrees_with_a_grip_of_29_6():
    grips = [SYNTHESIZER.solve(cylinder(tilt)).value for tilt in np.arange(0.0, 86.0)]
    assert grips[-1] == pytest.approx(29.57, abs=0.005)
    assert max(grips) == grips[-1]
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(cylinder(86.0))


@pytest.mark.parametrize(
    ("geometry", "last"),
    [({"depth": 0.02}, 84.0), ({"depth": 0.1}, 81.0), ({"upper_wall": False}, 82.0)],
)
def test_cylinder_held_elsewhere_is_feasible_less_far(geometry, last):
    SYNTHESIZER.solve(cylinder(last, **geometry))
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(cylinder(last + 1.0, **geometry))


def test_cylinder_s_fingers_swap_roles_where_the_rim_stands_under_the_centre_of_mass():
    outer, inner = SYNTHESIZER.solve(cylinder(50.0)).w_OC_C[:2, 2]
    assert outer < 1e-6 < inner
    outer, inner = SYNTHESIZER.solve(cylinder(55.0)).w_OC_C[:2, 2]
    assert inner < 1e-6 < outer


def test_cylinder_lift_off_needs_fifty_times_the_grip_limit():
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(cylinder(0.0, environment=False))
    assert SYNTHESIZER.solve(cylinder(0.0, environment=False, f_n_max=np.inf)).value > 1500.0


# --- agreement with the reference ---


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0, 90.0])
def test_box_agrees_with_the_reference(objective, tilt):
    assert_agrees_with_reference(box(tilt, joints=arms(), objective=objective))


@pytest.mark.parametrize("tilt", [0.0, 40.0, 60.0, 85.0])
def test_cylinder_agrees_with_the_reference(tilt):
    assert_agrees_with_reference(cylinder(tilt))
    assert_agrees_with_reference(replace(cylinder(tilt), objective=Objective.FRICTION_MARGIN))


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("seed", range(12))
def test_random_feasible_problem_agrees_with_the_reference(objective, seed):
    assert_agrees_with_reference(random_feasible(seed, objective))


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("seed", range(6))
def test_random_infeasible_problem_is_certified_and_infeasible_to_the_reference(objective, seed):
    problem = random_infeasible(seed, objective)
    with pytest.raises(InfeasibleError) as error:
        SYNTHESIZER.solve(problem)
    # No contact here carries more than a hundred times the load.
    assert error.value.certificate.proves(100.0 * load(problem))
    with pytest.raises(ReferenceInfeasibleError):
        solve_reference(problem)


# --- robustness ---


@settings(derandomize=True, deadline=None, max_examples=400)
@given(seed=st.integers(0, 10**9), exponent=st.sampled_from([-4, 0, 4]))
def test_random_feasible_problem_is_solved_at_any_scale_with_small_residuals(seed, exponent):
    problem = scaled(random_feasible(seed), 10.0**exponent)
    solution = SYNTHESIZER.solve(problem)
    # Ten times the accepted tolerance of 1e-8 on the scale of the largest force.
    assert solution.residuals.primal <= 1e-7 * max(load(problem), np.abs(solution.w_OC_C).max())


@settings(derandomize=True, deadline=None, max_examples=200)
@given(seed=st.integers(0, 10**9), exponent=st.sampled_from([-4, 4]))
def test_value_scales_with_the_load(seed, exponent):
    problem = random_feasible(seed)
    dimensionless = (Objective.FRICTION_MARGIN, Objective.MAX_TORQUE_UTILISATION)
    is_ratio = problem.objective in dimensionless
    factor = 10.0**exponent
    value = SYNTHESIZER.solve(problem).value
    expected = value if is_ratio else value * factor
    floor = 1e-2 if is_ratio else 1e-3 * load(problem) * factor
    # The numbers inside the solver are the same up to rounding and its tolerance.
    found = SYNTHESIZER.solve(scaled(problem, factor)).value
    assert abs(found - expected) <= AGREEMENT * max(abs(expected), floor)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(seed=st.integers(0, 10**9), exponent=st.sampled_from([-4, 0, 4]))
def test_random_infeasible_problem_is_found_infeasible_at_any_scale(seed, exponent):
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(scaled(random_infeasible(seed), 10.0**exponent))


@pytest.mark.parametrize("seed", range(30))
def test_fully_determined_normal_forces_are_solved(seed):
    # Upper and lower bounds meet at the forces that the grip problem finds.
    problem = replace(random_feasible(seed), objective=Objective.NORM_NORMAL_FORCE)
    solution = SYNTHESIZER.solve(problem)
    f_n = np.maximum(solution.w_OC_C[:, 2], 0.0)
    contacts = tuple(
        # The bounds leave the width of the solver's error, or they would cut the solution off.
        replace(c, f_n_min=max(0.0, f - 1e-6), f_n_max=f + 1e-6)
        for c, f in zip(problem.contacts, f_n.tolist(), strict=True)
    )
    value = SYNTHESIZER.solve(replace(problem, contacts=contacts)).value
    assert value == pytest.approx(solution.value, abs=1e-5)


@pytest.mark.parametrize("weight", [1e-2, 20.0, 1e4])
def test_single_frictionless_contact_carries_the_weight_exactly(weight):
    problem = Problem(
        contacts=(Contact("table", Role.HAND, ContactModel.FRICTIONLESS, f_n_max=weight),),
        R_OC=np.eye(3)[None],
        p_OC_O=np.zeros((1, 3)),
        w_ext_O=np.array([0.0, 0.0, -weight, 0.0, 0.0, 0.0]),
    )
    assert SYNTHESIZER.solve(problem).value == pytest.approx(weight, rel=1e-8)
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(scaled(replace(problem, w_ext_O=problem.w_ext_O * 1.001), 1.0))


def test_object_without_load_needs_no_force():
    problem = replace(box(), w_ext_O=np.zeros(6))
    # The solver's tolerance of 1e-9 in units of 1 N.
    assert SYNTHESIZER.solve(problem).value == pytest.approx(0.0, abs=1e-8)


def test_grip_limit_on_the_brink_separates_feasible_from_infeasible():
    grip = SYNTHESIZER.solve(box()).value

    def limited(f_n_max):
        problem = box()
        return replace(
            problem,
            contacts=tuple(
                replace(c, f_n_max=f_n_max) if c.role is Role.HAND else c for c in problem.contacts
            ),
        )

    # A hundred times the solver's tolerance to either side.
    assert SYNTHESIZER.solve(limited(grip * (1 + 1e-6))).value == pytest.approx(grip, rel=1e-6)
    with pytest.raises(InfeasibleError):
        SYNTHESIZER.solve(limited(grip * (1 - 1e-6)))


# --- one solver, many problems ---


@pytest.mark.parametrize("objective", Objective)
def test_reused_solver_gives_what_a_fresh_one_gives(objective):
    reused = Synthesizer()
    rng = np.random.default_rng(3)
    sparse = arms()
    # Exact zeros in the first problem only: the sparsity must not be taken from it.
    first = replace(sparse, J_C=np.where(np.abs(sparse.J_C) < 0.3, 0.0, sparse.J_C))
    reused.solve(box(0.0, joints=first, objective=objective))
    for tilt in rng.uniform(0.0, 90.0, size=8):
        joints = arms(seed=4)
        J_C = 0.2 * rng.normal(size=(2, 6, 14))
        wide = np.full(14, 200.0)
        joints = replace(joints, J_C=J_C, tau_min=-wide, tau_max=wide)
        problem = box(tilt, weight=rng.uniform(5.0, 30.0), joints=joints, objective=objective)
        assert reused.solve(problem).value == pytest.approx(
            # Two runs to 1e-9, differently scaled inside the solver.
            Synthesizer().solve(problem).value,
            rel=1e-7,
        )


def test_same_sequence_of_problems_gives_the_same_bits():
    def run():
        synthesizer = Synthesizer()
        return [synthesizer.solve(box(tilt)).w_OC_C.tobytes() for tilt in (0.0, 30.0, 60.0)]

    assert run() == run()
