"""The robust controller: its grip serves the set, its impedance leaves the squeeze alone."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.control.drives import Drives
from fulcrum.sim.model.grip import GripSchedule
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.planning.robust_grip import borne, plan_grip
from fulcrum.sim.scenario.control import Robustness, controllers
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.signals.setpoint import Setpoint
from fulcrum.sim.signals.target import Target
from fulcrum.synthesis import InvalidInputError, Synthesizer
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.robust.certificate import RobustInfeasibleError
from fulcrum.synthesis.robust.grip import robust_grip
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
from tests.helpers.plants import ROBOT, planned

BOX = scenario("box-tilt")
ROBUST = controllers(BOX.control)["robust"]
FULL = replace(BOX.control, friction_factor=1.0)


def asking(preload, **uncertainty):
    return replace(ROBUST, robustness=Robustness(UncertaintySet(**uncertainty), preload))


@cache
def schedule(preload=52.0, mass=0.2, friction=0.2):
    return plan_grip(BOX, asking(preload, mass=mass, friction=friction), planned())


def test_controls_without_robustness_have_no_schedule():
    assert plan_grip(BOX, BOX.control, planned()) is None


def test_the_grip_is_the_robust_counterpart_s_wherever_that_is_more_than_the_preload():
    problems, u = PathProblems(BOX, FULL, joint_path=planned()), UncertaintySet(0.2, friction=0.2)
    found = schedule(preload=30.0)
    tilts = np.degrees(found.tilts).tolist()
    for tilt, f_n in zip(tilts, found.f_n, strict=True):
        worlds = u.worlds(problems.problem(tilt), problems.gravity(tilt))
        np.testing.assert_allclose(f_n, np.maximum(robust_grip(worlds).f_n, 30.0), atol=1e-4)
    assert found.f_n.max() > 31.0
    assert found.f_n.min() == pytest.approx(30.0, abs=1e-4)
    np.testing.assert_array_equal(found.shares, 1.0)


def test_between_its_tilts_grip_is_interpolated_and_beyond_them_it_stays():
    grip = GripSchedule(np.array([0.0, 1.0]), np.array([[10.0, 1.0], [20.0, 3.0]]), np.ones(2))
    asked = grip.at(np.array([-1.0, 0.0, 0.25, 1.0, 2.0]))
    np.testing.assert_allclose(asked[:, 0], [10.0, 10.0, 12.5, 20.0, 20.0])
    np.testing.assert_allclose(asked[:, 1], [1.0, 1.0, 1.5, 3.0, 3.0])


def test_where_no_grip_gives_all_the_largest_share_found_does_and_a_sixteenth_more_does_not():
    hands = tuple(replace(hand, f_n_max=50.0) for hand in BOX.hands)
    scene = replace(BOX, hands=hands)
    control = asking(40.0, mass=0.5, friction=0.5)
    found = plan_grip(scene, control, planned())
    assert found.f_n.max() <= 50.0 + 1e-4
    assert 0.0 < found.shares[0] < 1.0
    problems = PathProblems(scene, FULL, joint_path=planned())
    problem, gravity = problems.problem(0.0), problems.gravity(0.0)
    u = control.robustness.uncertainty
    robust_grip(u.scaled(found.shares[0]).worlds(problem, gravity))
    with pytest.raises(RobustInfeasibleError):
        robust_grip(u.scaled(found.shares[0] + 1.0 / 16.0).worlds(problem, gravity))


def test_every_problem_on_the_path_asks_for_the_grip_of_its_tilt():
    grip = schedule()
    problems = PathProblems(BOX, ROBUST, joint_path=planned(), grip=grip)
    for tilt in (0.0, 20.0, 45.0, 90.0):
        solution = Synthesizer().solve(problems.problem(tilt))
        least = grip.at(np.radians([tilt]))[0]
        # Half a degree is one step of the least grip.
        assert (solution.w_OC_C[:2, N] >= least - 0.3).all()
    bare = PathProblems(BOX, ROBUST, joint_path=planned())
    assert Synthesizer().solve(bare.problem(70.0)).w_OC_C[:2, N].max() < 10.0


def test_how_much_is_borne_is_more_where_less_grip_is_needed():
    scalings = borne(BOX, asking(0.0, mass=0.2, friction=0.2), 45.0)
    assert list(scalings) == [0.0, 45.0, 90.0]
    assert 1.0 < scalings[0.0].factor < scalings[45.0].factor


def test_negative_preloads_are_refused():
    with pytest.raises(InvalidInputError, match=r"robustness\.preload"):
        Robustness(UncertaintySet(), -1.0)


# --- the impedance ---


def gripping(control, squeeze_n):
    """Drives that hold the box flat with a squeeze, the hands' Jacobians, and what q is."""
    q = planned().holding(0.0)
    drives = Drives(BOX, control, ROBOT)
    drives.update_model(ROBOT.at(q))
    problem = PathProblems(BOX, BOX.control, joint_path=planned()).problem(0.0)
    J_C = problem.joints.J_C
    w_OC_C = np.zeros((4, 6))
    w_OC_C[:2, N] = squeeze_n
    drives.follow(Setpoint(np.zeros(len(q)), w_OC_C, J_C))
    return drives, J_C, q


def seen(q):
    """A measurement of joints at rest."""
    none = np.zeros(len(q))
    return Measurement(0.0, q, none, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), none)


def target(q):
    return Target(0, 0.0, 1.0, q, np.zeros(len(q)))


def torque_of(drives, q, deviation):
    """What the impedance adds for a deviation of the angles."""
    off, there = (drives.torques(seen(q - d), target(q), 1.0)[0] for d in (deviation, 0.0))
    return off - there


def normal_forces(tau, J_C, q):
    """Normal forces that torques make of hands that cannot move."""
    J, mass_matrix = J_C.reshape(-1, J_C.shape[-1]), ROBOT.at(q).mass_matrix()
    compliance = J @ np.linalg.solve(mass_matrix, J.T)
    wrenches = np.linalg.solve(compliance, J @ np.linalg.solve(mass_matrix, tau))
    return wrenches.reshape(len(J_C), 6)[:, N]


@pytest.mark.parametrize("yielding", [True, False])
def test_the_impedance_adds_no_squeeze_but_still_resists_a_shift_of_both_hands(yielding):
    control = replace(ROBUST, yielding_squeeze=yielding)
    drives, J_C, q = gripping(control, 40.0)
    drives.torques(seen(q), target(q), 1.0)
    drives.update_model(ROBOT.at(q))
    push = np.linalg.pinv(J_C[:, N])
    # Both hands 0.1 mm off inwards, and both to the same side: their normals are opposed.
    squeeze = normal_forces(torque_of(drives, q, push @ [1e-4, 1e-4]), J_C, q)
    shift = normal_forces(torque_of(drives, q, push @ [1e-4, -1e-4]), J_C, q)
    # The same, if nothing else of the hands moves, with the least of kinetic energy.
    J = J_C.reshape(12, -1)
    weighted = np.linalg.solve(ROBOT.at(q).mass_matrix(), J.T)
    inwards = np.zeros((2, 6))
    inwards[:, N] = 1e-4
    pure = torque_of(drives, q, weighted @ np.linalg.solve(J @ weighted, inwards.ravel()))
    if yielding:
        # Rounding and a trace of damping, of some newtons without.
        assert abs(squeeze.sum()) < 1e-3
        assert np.abs(pure).max() < 1e-3
    else:
        assert squeeze.min() > 0.5
        assert np.abs(pure).max() > 0.1
    assert shift[0] > 0.5
    assert shift[1] < -0.5


def test_without_a_squeeze_nothing_is_taken_from_the_impedance():
    yielding, _, q = gripping(ROBUST, 0.0)
    plain, _, _ = gripping(replace(ROBUST, yielding_squeeze=False), 0.0)
    deviation = 1e-4 * np.ones(len(q))
    np.testing.assert_array_equal(torque_of(yielding, q, deviation), torque_of(plain, q, deviation))
