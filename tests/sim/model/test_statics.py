"""The measured state becomes the paper's problem, with the paper's numbers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.model.contacts import ContactFrames, contacts, true_contacts
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.statics import Statics
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.scenario.control import Control
from fulcrum.synthesis import (
    ContactModel,
    InfeasibleError,
    InvalidInputError,
    Objective,
    Role,
    Synthesizer,
)

BOX = scenario("box-tilt")
PAPER = Control(friction_factor=1.0, preload=0.0)
LIFTED = replace(BOX, supports=())

each_scenario = pytest.mark.parametrize("name", scenarios())


@cache
def robot(name):
    return RobotModel(scenario(name))


@cache
def planned(name):
    return plan_joints(scenario(name))


def problem_at(scene, control, tilt_deg):
    """The problem on the planned path at a tilt, with the arms where they hold it there."""
    tilt, belief = np.radians(tilt_deg), robot(scene.name)
    R_WO, p_WO = ScrewPath(scene.path).pose(tilt)
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    state = belief.at(planned(scene.name).holding(tilt))
    return Statics(scene, control).problem(state, p_WO, quaternion)


# --- the paper's numbers; 0.005 N is its last printed digit ---


@pytest.mark.parametrize(("tilt_deg", "grip"), [(0.0, 27.245), (90.0, 9.08)])
def test_largest_grip_is_the_paper_s_within_baxter_s_torques(tilt_deg, grip):
    solution = Synthesizer().solve(problem_at(BOX, PAPER, tilt_deg))
    assert solution.value == pytest.approx(grip, abs=0.005)
    joints = solution.problem.joints
    assert (joints.tau_min + 0.1 < solution.tau).all()
    assert (solution.tau < joints.tau_max - 0.1).all()


def test_grip_vanishes_at_the_balance_point_of_the_paper():
    balance = np.degrees(np.arctan(3.0))
    # The measured quaternion's rounding, and the solver's 1e-8 of 20 N.
    assert Synthesizer().solve(problem_at(BOX, PAPER, balance)).value < 1e-6
    assert Synthesizer().solve(problem_at(BOX, PAPER, balance - 1.0)).value > 0.1


@pytest.mark.parametrize("change", [{"friction_factor": 0.8}, {"preload": 30.0}])
def test_a_margin_changes_the_paper_s_number(change):
    solution = Synthesizer().solve(problem_at(BOX, replace(PAPER, **change), 0.0))
    assert solution.value > 27.245 + 1.0


def test_a_heavier_belief_or_a_shifted_centre_of_mass_changes_the_paper_s_number():
    heavier = replace(BOX, object=replace(BOX.object, mass=1.1 * BOX.object.mass))
    shifted = replace(BOX, object=replace(BOX.object, center_of_mass=(0.015, 0.0, 0.0)))
    # The moment about the edge is 1.1 times as large in both.
    for scene in (heavier, shifted):
        value = Synthesizer().solve(problem_at(scene, PAPER, 0.0)).value
        assert value == pytest.approx(1.1 * 27.245, abs=0.005)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 60.0])
def test_lift_off_is_infeasible_within_baxter_s_torques(tilt_deg):
    problem = problem_at(LIFTED, PAPER, tilt_deg)
    with pytest.raises(InfeasibleError) as error:
        Synthesizer().solve(problem)
    certificate = error.value.certificate
    # No force that the arms can make at levers of some 0.1 m exceeds 500 N.
    assert certificate.proves(500.0)
    # The proof rests on torque limits: without them the same multipliers prove nothing.
    weights = certificate.multipliers.weights(problem)
    limits = [name for name in weights if name.startswith("tau_m") and weights[name] > 1e-6]
    assert limits
    far = np.full(len(problem.joints.names), 1e4)
    strong = replace(problem, joints=replace(problem.joints, tau_min=-far, tau_max=far))
    assert not replace(certificate, problem=strong).proves(500.0)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 60.0])
def test_lift_off_without_torque_limits_takes_the_frictional_grip(tilt_deg):
    problem = replace(problem_at(LIFTED, PAPER, tilt_deg), joints=None)
    # Two hands with mu = 0.1 hold 20 N at 100 N each, and the moment of gravity besides.
    assert Synthesizer().solve(problem).value > 100.0


def test_lift_off_upright_is_feasible():
    assert Synthesizer().solve(problem_at(LIFTED, PAPER, 90.0)).value > 100.0


# --- the problem's parts ---


@each_scenario
@pytest.mark.parametrize("share", [0.0, 0.25, 0.5])
def test_weight_acts_at_the_centre_of_mass_in_the_object_s_axes(name, share):
    scene = scenario(name)
    tilt_deg = share * scene.path.angle_deg
    offset = (0.02, -0.01, 0.03)
    scene = replace(scene, object=replace(scene.object, center_of_mass=offset))
    problem = problem_at(scene, PAPER, tilt_deg)
    R_WO, _ = ScrewPath(scene.path).pose(np.radians(tilt_deg))
    force, moment = R_WO @ problem.w_ext_O[:3], R_WO @ problem.w_ext_O[3:]
    weight = [0.0, 0.0, -9.81 * scene.object.mass]
    # Two rotations of up to 50 N.
    np.testing.assert_allclose(force, weight, rtol=0, atol=1e-13)
    np.testing.assert_allclose(moment, np.cross(R_WO @ offset, weight), rtol=0, atol=1e-13)


@each_scenario
def test_joints_of_the_problem_are_the_robot_s_at_the_measured_angles(name):
    problem, belief = problem_at(scenario(name), PAPER, 30.0), robot(name)
    state = belief.at(planned(name).holding(np.radians(30.0)))
    assert problem.joints.names == belief.joints
    np.testing.assert_array_equal(problem.joints.tau_min, belief.tau_min)
    np.testing.assert_array_equal(problem.joints.tau_max, belief.tau_max)
    np.testing.assert_array_equal(problem.joints.tau_g, state.tau_g)
    state = belief.at(planned(name).holding(np.radians(31.0)))
    assert np.abs(problem.joints.tau_g - state.tau_g).max() > 1e-3


@each_scenario
def test_statics_balances_a_virtual_motion_of_hands_and_object(name):
    # Hands that follow the object do with the torques the work of the contact forces.
    problem, h = problem_at(scenario(name), PAPER, 30.0), 1e-6
    tilt = np.radians(30.0)
    path = ScrewPath(scenario(name).path)
    d = 1e-4
    slope = (planned(name).holding(tilt + d) - planned(name).holding(tilt - d)) / (2.0 * d)
    wrenches = np.random.default_rng(0).normal(size=(len(problem.contacts), 6))
    wrenches[:, 3:5] = 0.0
    tau = problem.torque(wrenches) - problem.joints.tau_g
    work = 0.0
    R_WO, _ = path.pose(tilt)
    (R_a, p_a), (R_b, p_b) = path.pose(tilt - h), path.pose(tilt + h)
    for i in problem.hands:
        p, R_WC = problem.p_OC_O[i], R_WO @ problem.R_OC[i]
        velocity = (p_b + R_b @ p - p_a - R_a @ p) / (2.0 * h)
        work += R_WC @ wrenches[i, :3] @ velocity + R_WC @ wrenches[i, 3:] @ path.direction
    # Central differences leave rounding over 2 h, 1e-10, and d^2 / 6 times a third derivative of
    # the path of ~10 rad: 2e-8; the spline's slope is off by 1e-6.
    assert tau @ slope == pytest.approx(work, abs=2e-5)
    assert abs(tau @ slope) > 1e-2


@each_scenario
def test_contacts_carry_the_scenario_s_friction_scaled_and_the_hands_the_preload(name):
    scene = scenario(name)
    control = Control(friction_factor=0.5, preload=3.0)
    for contact, source in zip(
        contacts(scene, control), (*scene.hands, *scene.supports), strict=True
    ):
        hand = source in scene.hands
        friction = source.friction
        assert contact.name == source.name
        assert contact.role is (Role.HAND if hand else Role.ENVIRONMENT)
        assert contact.mu == 0.5 * friction.mu
        assert contact.f_n_min == (3.0 if hand else 0.0)
        assert contact.f_n_max == (source.f_n_max if hand else np.inf)
        if friction.e_n is None:
            assert contact.model is ContactModel.PCWF
        else:
            assert contact.model is ContactModel.SFCE
            assert contact.e_n == friction.e_n
    assert [c.mu for c in true_contacts(scene)] == [
        c.friction.mu for c in (*scene.hands, *scene.supports)
    ]
    assert all(c.f_n_min == 0.0 for c in true_contacts(scene))


@each_scenario
def test_contact_frames_agree_between_object_and_world(name):
    frames = ContactFrames(scenario(name))
    R_WO = Rotation.from_rotvec([0.3, -0.8, 0.2]).as_matrix()
    # One product of rotations.
    in_world = R_WO @ frames.in_object(R_WO)
    np.testing.assert_allclose(frames.in_world(R_WO), in_world, rtol=0, atol=1e-15)
    stack = np.stack([np.eye(3), R_WO])
    np.testing.assert_array_equal(frames.in_world(stack)[1], frames.in_world(R_WO))
    # At supports the axes stay in the world, at hands in the object.
    hands = len(scenario(name).hands)
    moved = np.abs(frames.in_world(R_WO) - frames.in_world(np.eye(3))).max(axis=(1, 2))
    assert (moved[:hands] > 0.1).all()
    assert (moved[hands:] == 0.0).all()


@pytest.mark.parametrize("objective", Objective)
def test_the_control_s_objective_is_the_problem_s(objective):
    assert problem_at(BOX, replace(PAPER, objective=objective), 0.0).objective is objective


# --- the problems along the path ---


def same(first, second):
    """Whether two problems have the same numbers, bit by bit."""
    pairs = [(getattr(first, n), getattr(second, n)) for n in ("R_OC", "p_OC_O", "w_ext_O")]
    if None not in (first.joints, second.joints):
        pairs += [(getattr(first.joints, n), getattr(second.joints, n)) for n in ("J_C", "tau_g")]
    return all(np.array_equal(a, b) for a, b in pairs)


@each_scenario
def test_path_problems_are_those_of_the_planned_postures(name):
    scene = scenario(name)
    problems = PathProblems(scene, PAPER)
    middle = scene.path.angle_deg / 2.0
    at_middle = problems.problem(middle)
    assert same(at_middle, problem_at(scene, PAPER, middle))
    # Asked again after another tilt, it is the same; another tilt is another problem.
    other = problems.problem(middle + 1.0)
    assert same(problems.problem(middle), at_middle)
    assert not same(other, at_middle)


@each_scenario
def test_path_problems_without_joints_are_the_object_s_alone(name):
    scene = scenario(name)
    middle = scene.path.angle_deg / 2.0
    alone = PathProblems(scene, PAPER, with_joints=False).problem(middle)
    assert alone.joints is None
    assert same(alone, problem_at(scene, PAPER, middle))


@each_scenario
def test_a_problem_is_that_of_the_robot_s_state_whatever_came_before(name):
    scene, belief = scenario(name), RobotModel(scenario(name))
    R_WO, p_WO = ScrewPath(scene.path).pose(0.1)
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    statics, found = Statics(scene, PAPER), []
    for tilt in (0.1, 0.2, 0.1):
        state = belief.at(planned(name).holding(tilt))
        found.append(statics.problem(state, p_WO, quaternion))
    assert same(found[0], found[2])
    assert not same(found[0], found[1])


def test_a_tilt_beyond_the_path_has_no_problem():
    with pytest.raises(InvalidInputError, match=r"^tilt: got 95.0; valid is from 0 to 90 deg"):
        PathProblems(BOX, PAPER).problem(95.0)


# --- what a tracker hands over ---


@pytest.mark.parametrize("tilt_deg", [0.0, 33.3, 88.0])
@pytest.mark.parametrize("change", [lambda q: np.round(q, 6), lambda q: 1.2 * q, lambda q: -q])
def test_a_measured_orientation_need_not_be_of_length_one(tilt_deg, change):
    R_WO, p_WO = ScrewPath(BOX.path).pose(np.radians(tilt_deg))
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    statics = Statics(BOX, PAPER)
    asked, given = (statics.problem(None, p_WO, q) for q in (quaternion, change(quaternion)))
    # Half of the last digit of a rounded quaternion, in four numbers.
    np.testing.assert_allclose(given.R_OC, asked.R_OC, atol=4e-6)
    np.testing.assert_allclose(given.w_ext_O, asked.w_ext_O, atol=4e-6 * 20.0)


def test_no_finite_orientation_is_refused():
    statics = Statics(BOX, PAPER)
    rng = np.random.default_rng(0)
    for size in 10.0 ** np.linspace(-160.0, 3.0, 100):
        statics.problem(None, np.zeros(3), size * rng.normal(size=4))
    # What cannot be a pose still is.
    with pytest.raises(InvalidInputError):
        statics.problem(None, np.zeros(3), np.full(4, np.nan))
