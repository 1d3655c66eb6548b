"""The smallest changes that decide feasibility: facts, the reference, and a control."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import (
    Contact,
    ContactModel,
    InfeasibleError,
    Joints,
    Objective,
    Role,
    Synthesizer,
)
from fulcrum.synthesis.analysis.relaxation import (
    ChangeOutcome,
    Kind,
    _confirmed,
    _with_grip,
    change,
    changes,
    weight_range,
)
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.reference import ReferenceInfeasibleError, solve_reference
from fulcrum.synthesis.solution import shrink_cones
from tests.helpers.problems import arms, box, cylinder, random_feasible, random_infeasible

SYNTHESIZER = Synthesizer()
# The bisection's last interval and the solver's tolerance, with forces up to 60 times the weight.
EXACT = 1e-6


def weight_of(problem):
    weight = float(np.linalg.norm(problem.w_ext_O[:3]))
    return Gravity(weight, problem.w_ext_O[:3] / weight, np.zeros(3))


def change_of(kind, problem):
    return change(kind, problem, weight_of(problem), SYNTHESIZER)


def lift_off(f_n_max=math.inf, weight=20.0):
    problem = box(0.0, environment=False, weight=weight)
    contacts = tuple(replace(c, f_n_max=f_n_max) for c in problem.contacts)
    return replace(problem, contacts=contacts)


GRIP = SYNTHESIZER.solve(lift_off()).value


# --- the box off the ground: its grip of 101.1 N is the only number that matters ---


def test_box_is_lifted_with_101_newtons_and_so_is_any_weight():
    assert pytest.approx(101.1, abs=0.1) == GRIP
    weight = change_of(Kind.WEIGHT, lift_off())
    assert (weight.outcome, weight.factor) == (ChangeOutcome.ALWAYS, math.inf)
    assert weight.confirmed_within == 0.0


def test_too_weak_a_grip_has_to_grow_to_the_101_newtons():
    grip = change_of(Kind.GRIP, lift_off(80.0))
    assert grip.factor * 80.0 == pytest.approx(GRIP, rel=EXACT)
    assert grip.confirmed_within <= 1e-5


def test_too_strong_a_grip_may_shrink_to_the_101_newtons():
    grip = change_of(Kind.GRIP, lift_off(130.0))
    assert grip.factor * 130.0 == pytest.approx(GRIP, rel=EXACT)


@pytest.mark.parametrize("f_n_max", [80.0, 130.0])
def test_weight_that_a_grip_limit_allows_is_proportional_to_it(f_n_max):
    problem = lift_off(f_n_max)
    factor = change_of(Kind.WEIGHT, problem).factor
    assert factor == pytest.approx(f_n_max / GRIP, rel=EXACT)
    span = weight_range(problem, weight_of(problem), SYNTHESIZER)
    assert span == (0.0, pytest.approx(20.0 * factor, rel=EXACT))


def test_torque_limits_are_absent_without_joints():
    assert change_of(Kind.TORQUE, lift_off()).outcome is ChangeOutcome.ABSENT
    assert change_of(Kind.GRIP, lift_off()).outcome is ChangeOutcome.ABSENT


def test_frictionless_contacts_have_no_friction_to_change():
    contacts = tuple(replace(c, model=ContactModel.FRICTIONLESS) for c in lift_off().contacts)
    friction = change_of(Kind.FRICTION, replace(lift_off(), contacts=contacts))
    assert friction.outcome is ChangeOutcome.ABSENT


# --- the cylinder ---


def test_cylinder_lift_off_takes_a_grip_of_1697_newtons():
    problem = cylinder(0.0, environment=False)
    grip = change_of(Kind.GRIP, problem)
    assert grip.factor * 30.0 == pytest.approx(1696.7, abs=0.1)
    assert grip.confirmed_within <= 1e-4
    # Forces of 1697 N in equations that hold to 1e-9 of the load leave 1e-5.
    weight = change_of(Kind.WEIGHT, problem)
    assert weight.factor * grip.factor == pytest.approx(1.0, rel=1e-5)


def test_cylinder_lift_off_is_helped_by_no_friction():
    friction = change_of(Kind.FRICTION, cylinder(0.0, environment=False))
    assert friction.outcome is ChangeOutcome.NEVER
    assert friction.factor > 1000.0
    assert friction.conflict.proves(1e3)


@pytest.mark.parametrize(
    "problem", [cylinder(20.0), cylinder(40.0), cylinder(80.0), box(30.0, joints=arms())]
)
def test_friction_may_shrink_to_the_friction_margin(problem):
    # Dinkelbach's method finds the same number by another way.
    margin = SYNTHESIZER.solve(replace(problem, objective=Objective.FRICTION_MARGIN)).value
    assert change_of(Kind.FRICTION, problem).factor == pytest.approx(margin, rel=1e-5)


# --- any problem ---


@pytest.mark.parametrize("make", [random_feasible, random_infeasible])
@pytest.mark.parametrize("seed", range(15))
def test_every_border_is_confirmed_by_solving_again(make, seed):
    problem = make(seed)
    if make(seed).objective is Objective.FRICTION_MARGIN:
        problem = replace(problem, objective=Objective.NORM_NORMAL_FORCE)
    for found in changes(problem, weight_of(problem), SYNTHESIZER).values():
        # Friction coefficients beyond 10 are nobody's, and ill-conditioned.
        largest = found.factor * max(c.mu for c in problem.contacts)
        if found.kind is not Kind.FRICTION or largest < 10.0:
            assert found.confirmed_within <= 1e-4, found.kind
        if found.outcome is ChangeOutcome.NEVER:
            assert found.conflict.proves(1e3)


@pytest.mark.parametrize("seed", range(15))
def test_harmful_side_of_a_feasible_problem_is_where_its_factor_lies(seed):
    problem = random_feasible(seed, Objective.MAX_NORMAL_FORCE)
    found = changes(problem, weight_of(problem), SYNTHESIZER)
    # Feasible forces may be the only ones: then the factor is 1 but for the solver's tolerance.
    assert found[Kind.WEIGHT].factor > 1.0 - 1e-6
    for kind in (Kind.FRICTION, Kind.TORQUE, Kind.GRIP):
        assert found[kind].factor < 1.0 + 1e-6


@pytest.mark.parametrize("problem", [lift_off(80.0), cylinder(40.0), cylinder(86.0)])
def test_borders_are_the_reference_s(problem):
    """CVXPY, which shares no code, is feasible on one side and infeasible on the other."""

    def feasible(changed):
        try:
            solve_reference(changed)
        except ReferenceInfeasibleError:
            return False
        return True

    def heavier(factor):
        return replace(problem, w_ext_O=factor * problem.w_ext_O)

    weight = change_of(Kind.WEIGHT, problem).factor
    assert feasible(heavier(0.999 * weight)) and not feasible(heavier(1.001 * weight))
    found = change_of(Kind.FRICTION, problem)
    if found.outcome is ChangeOutcome.BOUND:
        assert feasible(shrink_cones(problem, 1.001 * found.factor))
        assert not feasible(shrink_cones(problem, 0.999 * found.factor))


@pytest.mark.parametrize("error", [0.99, 1.01])
def test_a_wrong_factor_is_not_confirmed(error):
    family = _with_grip(lift_off(80.0))
    right = GRIP / 80.0
    assert _confirmed(Kind.GRIP, family, right, math.inf, SYNTHESIZER).confirmed_within <= 1e-5
    wrong = _confirmed(Kind.GRIP, family, error * right, math.inf, SYNTHESIZER)
    assert wrong.confirmed_within == math.inf


# --- when nothing of a kind helps ---


def test_preload_beyond_a_torque_limit_is_helped_by_no_weight():
    # One joint pushes straight along the left hand's normal: its torque is that normal force.
    J_C = np.zeros((2, 6, 1))
    J_C[0, 2, 0] = 1.0
    joints = Joints(("slider",), J_C, np.zeros(1), np.array([-5.0]), np.array([5.0]))
    hands = tuple(replace(c, f_n_min=10.0) for c in box(85.0).contacts[:2])
    problem = replace(box(85.0, joints=joints), contacts=(*hands, *box(85.0).contacts[2:]))
    weight = change_of(Kind.WEIGHT, problem)
    assert weight.outcome is ChangeOutcome.NEVER
    assert weight.conflict.proves(1e3)
    with pytest.raises(InfeasibleError) as error:
        weight_range(problem, weight_of(problem), SYNTHESIZER)
    assert error.value.certificate.proves(1e3)
    assert change_of(Kind.FRICTION, problem).outcome is ChangeOutcome.NEVER
    assert change_of(Kind.TORQUE, problem).factor == pytest.approx(2.0, rel=EXACT)


def test_grip_limit_cannot_shrink_below_the_preload():
    contacts = tuple(replace(c, f_n_min=10.0, f_n_max=40.0) for c in box(85.0).contacts[:2])
    problem = replace(box(85.0), contacts=(*contacts, *box(85.0).contacts[2:]))
    grip = change_of(Kind.GRIP, problem)
    assert grip.factor == pytest.approx(0.25, rel=EXACT)
    assert grip.confirmed_within <= 1e-5


def test_preload_asks_for_a_least_weight():
    # A hand that pushes up from below, with 5 N at least: only a weight of 5 N holds against it.
    below = Contact("below", Role.HAND, ContactModel.PCWF, mu=0.5, f_n_min=5.0, f_n_max=30.0)
    problem = replace(
        box(0.0),
        contacts=(below,),
        R_OC=np.eye(3)[None],
        p_OC_O=np.array([[0.0, 0.0, -0.05]]),
    )
    span = weight_range(problem, weight_of(problem), SYNTHESIZER)
    assert span == pytest.approx((5.0, 30.0), rel=EXACT)
    light = replace(problem, w_ext_O=0.1 * problem.w_ext_O)
    weight = change_of(Kind.WEIGHT, light)
    assert weight.factor == pytest.approx(2.5, rel=EXACT)
