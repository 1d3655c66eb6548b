"""One grip for many worlds: against (17) itself, the CVXPY reference, and worlds left out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fulcrum.synthesis import InvalidInputError, Objective, Synthesizer
from fulcrum.synthesis.reference import ReferenceInfeasibleError
from fulcrum.synthesis.robust.certificate import RobustCertificate, RobustInfeasibleError
from fulcrum.synthesis.robust.grip import robust_grip
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
from tests.helpers.problems import arms, box, random_feasible, random_infeasible
from tests.helpers.robust_reference import solve_robust_reference
from tests.helpers.worlds import gravity_of, gripped, is_served, member

GRIP_OBJECTIVES = (Objective.MAX_NORMAL_FORCE, Objective.NORM_NORMAL_FORCE)
# Both sides solve to 1e-8 at worst, relative to forces that may be a hundred times the value.
AGREEMENT = 1e-6
SYNTHESIZER = Synthesizer()
LAB = UncertaintySet(mass=0.1, center=(0.01, 0.01, 0.01), friction=0.15)
PUSHED = replace(LAB, push=(1.0, 1.0, 1.0), lever=(0.15, 0.1, 0.05))
# No joint torque goes into holding the arms, so that all of it is left for the grip.
STRONG = replace(arms(), tau_g=np.zeros(14))


def worlds(tilt_deg, uncertainty, **fields):
    problem = box(tilt_deg, **fields)
    return uncertainty.worlds(problem, gravity_of(problem))


def size(problem):
    return max(problem.load, 1.0)


# --- one world: nothing but (17) ---


@pytest.mark.parametrize("objective", GRIP_OBJECTIVES)
@pytest.mark.parametrize("tilt", [0.0, 45.0, 90.0])
def test_grip_for_one_world_is_that_of_the_problem(objective, tilt):
    problem = box(tilt, joints=arms(), objective=objective)
    grip = robust_grip([problem])
    assert grip.value == pytest.approx(SYNTHESIZER.solve(problem).value, rel=AGREEMENT)
    assert grip.residuals.max() < AGREEMENT


@settings(derandomize=True, deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**9), objective=st.sampled_from(GRIP_OBJECTIVES))
def test_grip_for_one_random_world_said_thrice_is_that_of_the_problem(seed, objective):
    problem = random_feasible(seed, objective)
    grip = robust_grip([problem] * 3)
    expected = SYNTHESIZER.solve(problem).value
    assert abs(grip.value - expected) <= AGREEMENT * max(expected, 1e-2 * size(problem))


# --- many worlds ---


@pytest.mark.parametrize("objective", GRIP_OBJECTIVES)
@pytest.mark.parametrize("tilt", [0.0, 30.0, 70.0])
@pytest.mark.parametrize("joints", [None, STRONG], ids=["free", "joints"])
def test_grip_agrees_with_the_reference(objective, tilt, joints):
    problems = worlds(tilt, LAB, objective=objective, joints=joints)
    assert len(problems) > 4
    expected = solve_robust_reference(problems)
    assert robust_grip(problems).value == pytest.approx(expected, rel=AGREEMENT)


@settings(derandomize=True, deadline=None, max_examples=10)
@given(seed=st.integers(0, 10**9), objective=st.sampled_from(GRIP_OBJECTIVES))
def test_random_worlds_have_the_reference_s_grip_or_none(seed, objective):
    problem = random_feasible(seed, objective)
    rng = np.random.default_rng(seed)
    load = np.abs(problem.w_ext_O).max()
    problems = [
        replace(problem, w_ext_O=problem.w_ext_O + 0.05 * load * rng.normal(size=6))
        for _ in range(3)
    ]
    try:
        expected = solve_robust_reference(problems)
    except ReferenceInfeasibleError:
        with pytest.raises(RobustInfeasibleError):
            robust_grip(problems)
    else:
        value = robust_grip(problems).value
        assert abs(value - expected) <= AGREEMENT * max(expected, 1e-2 * size(problem))


@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_grip_serves_every_world_and_no_world_s_own_is_larger(tilt):
    problems = worlds(tilt, LAB, joints=arms())
    grip = robust_grip(problems)
    assert all(is_served(problem, grip.f_n) for problem in problems)
    needs = [SYNTHESIZER.solve(problem).value for problem in problems]
    assert grip.value >= max(needs) * (1.0 - AGREEMENT)


@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_a_little_less_grip_leaves_a_world_out(tilt):
    problems = worlds(tilt, LAB)
    f_n = robust_grip(problems).f_n
    # Both hands of the symmetric object are needed in full.
    assert not all(is_served(problem, 0.999 * f_n) for problem in problems)


@pytest.mark.parametrize("tilt", [0.0, 50.0, 90.0])
def test_grip_serves_random_worlds_within_the_set(tilt):
    problem = box(tilt, joints=STRONG)
    gravity, rng = gravity_of(problem), np.random.default_rng(int(tilt))
    f_n = robust_grip(PUSHED.worlds(problem, gravity)).f_n
    for _ in range(6):
        assert is_served(member(rng, problem, gravity, PUSHED), f_n)


@pytest.mark.parametrize("tilt", [0.0, 50.0, 90.0])
def test_grip_does_not_serve_worlds_twice_as_far_off(tilt):
    problem = box(tilt)
    gravity = gravity_of(problem)
    f_n = robust_grip(LAB.worlds(problem, gravity)).f_n
    outside = LAB.scaled(2.0).worlds(problem, gravity)
    assert not all(is_served(world, f_n) for world in outside)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    tilt=st.floats(0.0, 90.0),
    factors=st.tuples(st.floats(0.0, 1.5), st.floats(0.0, 1.5)).map(sorted),
)
def test_a_larger_set_takes_no_less_grip(tilt, factors):
    problem = box(tilt)
    gravity = gravity_of(problem)
    less, more = (
        robust_grip(LAB.scaled(factor).worlds(problem, gravity)).value for factor in factors
    )
    assert more >= less - AGREEMENT * size(problem)


# --- residuals are computed, not believed ---


@pytest.mark.parametrize(
    "tamper",
    [
        lambda g: replace(g, w_OC_C=1.001 * g.w_OC_C),
        lambda g: replace(g, f_n=1.001 * g.f_n),
        lambda g: replace(g, tau=g.tau + 100.0),
        lambda g: replace(g, tau=g.tau - 100.0),
        # Moments that point contacts do not transmit, and that balance each other.
        lambda g: replace(g, w_OC_C=g.w_OC_C + np.outer([0, 0, 1e-3, -1e-3], np.eye(6)[3])),
        lambda g: replace(
            g, problems=tuple(replace(p, w_ext_O=p.w_ext_O * 1.001) for p in g.problems)
        ),
        lambda g: replace(g, problems=worlds(30.0, replace(LAB, friction=0.2), joints=STRONG)),
        lambda g: replace(g, problems=tuple(gripped(p, g.f_n + 0.01) for p in g.problems)),
        lambda g: replace(g, problems=tuple(gripped(p, g.f_n - 0.01) for p in g.problems)),
    ],
)
def test_residual_shows_what_was_tampered_with(tamper):
    grip = robust_grip(worlds(30.0, LAB, joints=STRONG))
    assert grip.residuals.max() < AGREEMENT
    assert tamper(grip).residuals.max() > 1e-5


# --- no grip ---


def contradiction():
    """A heavy world that takes much grip, and one whose weak joints do not allow it."""
    heavy = box(0.0, joints=STRONG)
    needed = SYNTHESIZER.solve(heavy).tau
    light = box(0.0, weight=5.0, joints=STRONG)
    weak = replace(STRONG, tau_min=-0.6 * np.abs(needed), tau_max=0.6 * np.abs(needed))
    return heavy, replace(light, joints=weak)


def test_worlds_that_contradict_each_other_only_together_are_proven_infeasible():
    heavy, light = contradiction()
    for world in (heavy, light):
        robust_grip([world])
    with pytest.raises(RobustInfeasibleError, match="all 2 worlds; most binding") as error:
        robust_grip([heavy, light])
    proof = error.value.certificate
    assert proof.proves(1e4)
    # Neither world's multipliers prove anything without the other's.
    for world, multipliers in zip(proof.problems, proof.multipliers, strict=True):
        assert not RobustCertificate((world,), (multipliers,)).proves(1e2)


def test_certificate_of_other_worlds_proves_nothing():
    heavy, light = contradiction()
    with pytest.raises(RobustInfeasibleError) as error:
        robust_grip([heavy, light])
    multipliers = error.value.certificate.multipliers
    assert not RobustCertificate((heavy, heavy), multipliers).proves(1e2)
    assert not RobustCertificate((light, light), multipliers).proves(1e2)


@pytest.mark.parametrize("world", [0, 1])
@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("equilibrium", 1e-3),
        # Of the cones the tangential components alone: they are each world's own.
        ("cone", 1e-3 * np.eye(6)[0]),
        ("tau_max", 1e-3),
        ("f_n_min", -1e-3),
    ],
)
def test_certificate_that_was_tampered_with_proves_nothing(world, field, change):
    with pytest.raises(RobustInfeasibleError) as error:
        robust_grip(contradiction())
    proof = error.value.certificate
    assert proof.proves(1e4)
    multipliers = list(proof.multipliers)
    tampered = {field: getattr(multipliers[world], field) + change}
    multipliers[world] = replace(multipliers[world], **tampered)
    assert not replace(proof, multipliers=tuple(multipliers)).proves(1e4)


def test_limits_far_too_wide_change_nothing():
    # Some limits far beyond the forces must not drown them in the solver's norms.
    problem = box(30.0, joints=STRONG)
    wide = replace(STRONG, tau_min=-1e9 * STRONG.tau_max, tau_max=1e9 * STRONG.tau_max)
    contacts = tuple(replace(c, f_n_max=1e10) for c in problem.contacts)
    loose = replace(problem, contacts=contacts, joints=wide)
    free = robust_grip(LAB.worlds(box(30.0), gravity_of(problem)))
    grip = robust_grip(LAB.worlds(loose, gravity_of(loose)))
    assert grip.value == pytest.approx(free.value, rel=AGREEMENT)
    # A solver that stalls on them leaves 1e-8 or more, one that does not 1e-15.
    assert grip.residuals.max() < 1e-11


@pytest.mark.parametrize("seed", range(30))
def test_one_infeasible_world_is_enough(seed):
    problem = random_infeasible(seed, Objective.MAX_NORMAL_FORCE)
    nothing = replace(problem, w_ext_O=np.zeros(6))
    with pytest.raises(RobustInfeasibleError) as error:
        robust_grip([nothing, problem])
    assert error.value.certificate.proves(100.0 * size(problem))


# --- refusals ---


def renamed(problem):
    first, *others = problem.contacts
    return replace(problem, contacts=(replace(first, name="paw"), *others))


def bounded(problem):
    first, *others = problem.contacts
    return replace(problem, contacts=(replace(first, f_n_max=99.0), *others))


def fewer(problem):
    return box(0.0, environment=False, joints=problem.joints)


def limp(problem):
    return replace(problem, joints=None)


@pytest.mark.parametrize("change", [renamed, bounded, fewer, limp])
def test_worlds_that_do_not_belong_together_are_refused(change):
    problem = box(0.0, joints=arms())
    with pytest.raises(InvalidInputError, match=r"problems\[1\]: got another structure"):
        robust_grip([problem, change(problem)])


def test_no_world_is_refused():
    with pytest.raises(InvalidInputError, match="problems: got no world"):
        robust_grip([])


@pytest.mark.parametrize("objective", [o for o in Objective if o not in GRIP_OBJECTIVES])
def test_objectives_of_more_than_the_grip_are_refused(objective):
    with pytest.raises(InvalidInputError, match="objective"):
        robust_grip([box(0.0, joints=arms(), objective=objective)])
