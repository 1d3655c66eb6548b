"""The controller commands what statics asks for, within limits, and says when it cannot."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.control.controller import ForceController
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.statics import Statics
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.scenario.control import Control, controllers
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.synthesis import InvalidInputError, Objective, Synthesizer
from fulcrum.synthesis.arrays import N
from tests.helpers.unguarded import UNGUARDED

BOX = scenario("box-tilt")
# The guard is left out: states here jump as no run does. What it does is in test_guard.py.
CONTROL = replace(BOX.control, solve_every=1, guard=UNGUARDED)
SCHEDULE = Schedule(BOX)
NAMES = [phase.name for phase in BOX.phases]
# When the hands touch, when they have gripped, and when the box is tilted [s].
TOUCHED_S, GRIPPED_S, END_S = (
    float(SCHEDULE.ends[NAMES.index(name)]) for name in ("touch", "grip", "tilt")
)
# Torques of 50 N·m are sums of some 20 products; solvers that meet the same data are the same.
ROUNDING = 1e-12


@cache
def planned():
    return plan_joints(BOX)


def controller(control=CONTROL, scene=BOX):
    made = ForceController(control, planned())
    made.reset(scene, RobotModel(scene), seed=0)
    return made


def measured(tilt_deg, t, q=None, qd=None):
    """The object on its path at a tilt, and the robot holding it, unless said otherwise."""
    R_WO, p_WO = ScrewPath(BOX.path).pose(np.radians(tilt_deg))
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    q = planned().holding(np.radians(tilt_deg)) if q is None else q
    none = np.zeros(len(q))
    return Measurement(t, q, none if qd is None else qd, p_WO, quaternion, tau=none)


def problem_of(measurement):
    robot = RobotModel(BOX).at(measurement.q)
    return Statics(BOX, CONTROL).problem(robot, measurement.p_WO, measurement.quat_WO)


def heavier(weight):
    """A belief in which the box weighs so much [N]."""
    return replace(BOX, object=replace(BOX.object, mass=weight / 9.81))


# --- what is commanded ---


def test_gripped_and_on_its_path_it_commands_the_synthesised_torques():
    for tilt_deg, t in ((0.0, GRIPPED_S), (90.0, END_S)):
        measurement = measured(tilt_deg, t)
        command = controller().command(measurement)
        problem = problem_of(measurement)
        solution = Synthesizer().solve(problem)
        # The reference is the measured state up to the spline's rounding, times omega^2 M.
        np.testing.assert_allclose(command.tau, solution.tau, rtol=0, atol=1e-10)
        np.testing.assert_array_equal(command.w_commanded_C, solution.w_OC_C)
        assert np.abs(command.tau - problem.joints.tau_g).max() > 1.0
        assert not command.failed
        assert not command.saturated.any()
        assert command.synthesis_s > 0.0


def resting_where_it_should_be(t):
    """What is measured when the robot rests in its reference posture."""
    reference = SCHEDULE.at(t)
    q = planned().at(reference.phase, reference.progress)[0]
    return measured(np.degrees(reference.tilt), t, q)


@pytest.mark.parametrize("t", [0.0, TOUCHED_S, SCHEDULE.total_s - 0.5, SCHEDULE.total_s + 1.0])
def test_without_grip_it_only_holds_the_arms_up(t):
    measurement = resting_where_it_should_be(t)
    command = controller().command(measurement)
    belief = RobotModel(BOX)
    state = belief.at(measurement.q)
    np.testing.assert_allclose(command.tau, state.tau_g, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(command.w_commanded_C, 0.0)


def test_nothing_is_synthesised_in_phases_that_ask_for_no_grip():
    middles = (SCHEDULE.starts + SCHEDULE.ends) / 2.0
    commands = [controller().command(resting_where_it_should_be(float(t))) for t in middles]
    assert [c.phase for c in commands] == list(range(len(NAMES)))
    assert [c.synthesis_s > 0.0 for c in commands] == (~SCHEDULE.free).tolist()
    assert not any(c.failed for c in commands)
    # A belief that has no solution fails in those phases, and in no others.
    hopeless = [
        controller(scene=heavier(500.0)).command(resting_where_it_should_be(float(t)))
        for t in middles
    ]
    failed = [NAMES[i] for i in np.flatnonzero([c.failed for c in hopeless])]
    assert {"grip", "tilt"} <= set(failed) <= set(np.array(NAMES)[~SCHEDULE.free])


def test_half_way_through_letting_go_it_commands_half_of_the_forces():
    letting_go = (
        SCHEDULE.starts[NAMES.index("let go")] + 0.5 * BOX.phases[NAMES.index("let go")].duration_s
    )
    half = controller().command(measured(90.0, float(letting_go)))
    full = controller().command(measured(90.0, END_S))
    np.testing.assert_allclose(half.w_commanded_C, full.w_commanded_C / 2.0, rtol=0, atol=ROUNDING)
    assert full.w_commanded_C[:2, 2].min() > 5.0


def test_half_way_through_the_grip_it_commands_half_of_the_forces():
    half = controller().command(measured(0.0, (TOUCHED_S + GRIPPED_S) / 2.0))
    full = controller().command(measured(0.0, GRIPPED_S))
    np.testing.assert_allclose(half.w_commanded_C, full.w_commanded_C / 2.0, rtol=0, atol=ROUNDING)
    none = controller().command(measured(0.0, TOUCHED_S))
    np.testing.assert_allclose(half.tau, (full.tau + none.tau) / 2.0, rtol=0, atol=1e-10)


def test_without_feedforward_it_never_commands_forces():
    control = replace(CONTROL, feedforward=False)
    measurement = measured(0.0, GRIPPED_S)
    command = controller(control).command(measurement)
    belief = RobotModel(BOX)
    state = belief.at(measurement.q)
    np.testing.assert_allclose(command.tau, state.tau_g, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(command.w_commanded_C, 0.0)


def test_a_deviation_is_answered_by_impedance_of_the_bandwidth():
    t, rng = GRIPPED_S + 4.0, np.random.default_rng(0)
    reference = SCHEDULE.at(t)
    tilt_deg, rate = np.degrees(reference.tilt), reference.rate
    q_ref, slope = planned().at(reference.phase, reference.progress)
    dq, dqd = 1e-3 * rng.normal(size=(2, len(q_ref)))
    # Forces, gravity and mass matrix are those of the measured angles, so that they drop out.
    q, qd_ref = q_ref + dq, slope * rate
    belief = RobotModel(BOX)
    state = belief.at(q)
    M = state.mass_matrix()
    moving = controller().command(measured(tilt_deg, t, q, qd_ref + dqd))
    stiffer = replace(CONTROL, bandwidth=0.0)
    passive = controller(stiffer).command(measured(tilt_deg, t, q, qd_ref + dqd))
    omega = CONTROL.bandwidth
    expected = M @ (-(omega**2) * dq - 2.0 * omega * dqd)
    assert not moving.saturated.any()
    np.testing.assert_allclose(moving.tau - passive.tau, expected, rtol=0, atol=1e-10)
    assert np.abs(expected).max() > 0.1
    # Without impedance, what is left over statics is the joints' friction at the reference speed.
    problem = problem_of(measured(tilt_deg, t, q))
    friction = passive.tau - Synthesizer().solve(problem).tau
    np.testing.assert_allclose(friction, belief.damping * qd_ref, rtol=0, atol=1e-10)
    assert np.abs(friction).max() > 0.01


def test_reference_is_the_planned_path_at_the_scheduled_tilt():
    for t in (0.0, 1.0, 2.0, 3.0, 5.0, 9.4, 13.5, 16.0):
        command, reference = controller().command(measured(0.0, t)), SCHEDULE.at(t)
        assert (command.tilt_ref, command.phase) == (reference.tilt, reference.phase)
        expected = planned().at(reference.phase, reference.progress)[0]
        np.testing.assert_array_equal(command.q_ref, expected)


def test_synthesis_is_due_every_so_many_ticks_and_its_forces_hold_between():
    control = replace(CONTROL, solve_every=3)
    it = controller(control)
    tilts = (0.0, 10.0, 20.0, 30.0, 40.0)
    commands = [it.command(measured(tilt, GRIPPED_S)) for tilt in tilts]
    assert [c.synthesis_s > 0.0 for c in commands] == [True, False, False, True, False]
    for kept in commands[1:3]:
        np.testing.assert_array_equal(kept.w_commanded_C, commands[0].w_commanded_C)
    assert np.abs(commands[3].w_commanded_C - commands[0].w_commanded_C).max() > 0.1
    np.testing.assert_array_equal(commands[4].w_commanded_C, commands[3].w_commanded_C)


# --- when it cannot ---


def test_it_holds_the_last_forces_and_says_so_when_there_is_no_solution():
    # Near its balance the arms can hold a box of 60 N, flat on the table they cannot.
    it = controller(scene=heavier(60.0))
    upright = it.command(measured(80.0, GRIPPED_S))
    assert not upright.failed
    flat = it.command(measured(0.0, GRIPPED_S))
    assert flat.failed
    np.testing.assert_array_equal(flat.w_commanded_C, upright.w_commanded_C)
    assert np.isfinite(flat.tau).all()
    # It recovers as soon as there is one.
    again = it.command(measured(80.0, GRIPPED_S))
    assert not again.failed
    # The grip, which is minimised, to the solver's 1e-9 of 60 N. The edge bears what the hands'
    # friction does not, and that moves along the curve of the cone by the root of a change of grip:
    # sqrt(1e-9) of 60 N is 2e-3 N; measured 1.1e-6.
    difference = again.w_commanded_C[:, N] - upright.w_commanded_C[:, N]
    np.testing.assert_allclose(difference[:2], 0.0, rtol=0, atol=1e-7)
    np.testing.assert_allclose(difference[2:], 0.0, rtol=0, atol=1e-5)
    # What the edge's ends push against each other is free, and depends on what was solved before.
    np.testing.assert_allclose(again.w_commanded_C, upright.w_commanded_C, rtol=0, atol=1e-3)


def test_the_true_weight_has_a_solution_at_the_same_tilts():
    it = controller()
    assert not it.command(measured(80.0, GRIPPED_S)).failed
    assert not it.command(measured(0.0, GRIPPED_S)).failed


def test_without_any_solution_it_only_holds_the_arms_up():
    measurement = measured(0.0, GRIPPED_S)
    command = controller(scene=heavier(500.0)).command(measurement)
    assert command.failed
    belief = RobotModel(BOX)
    state = belief.at(measurement.q)
    np.testing.assert_allclose(command.tau, state.tau_g, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(command.w_commanded_C, 0.0)


@pytest.mark.parametrize("seed", range(10))
def test_torques_are_finite_and_within_limits_and_cuts_are_flagged(seed):
    rng = np.random.default_rng(seed)
    belief = RobotModel(BOX)
    cut = 0
    for scale in (1e-3, 1e-1, 10.0):
        tilt_deg, t = rng.uniform(0.0, 90.0), rng.uniform(0.0, SCHEDULE.total_s)
        q = rng.uniform(belief.q_min, belief.q_max)
        qd = scale * rng.normal(size=len(q))
        command = controller().command(measured(tilt_deg, t, q, qd))
        assert np.isfinite(command.tau).all()
        assert (belief.tau_min <= command.tau).all()
        assert (command.tau <= belief.tau_max).all()
        at_limit = (command.tau == belief.tau_min) | (command.tau == belief.tau_max)
        np.testing.assert_array_equal(command.saturated, at_limit)
        cut += command.saturated.sum()
    assert cut > 0


def test_without_the_object_s_pose_it_sends_no_forces_but_holds_the_arms_up():
    measurement = measured(0.0, GRIPPED_S)._replace(p_WO=np.array([0.65, np.nan, 0.05]))
    command = controller().command(measurement)
    belief = RobotModel(BOX)
    state = belief.at(measurement.q)
    np.testing.assert_allclose(command.tau, state.tau_g, rtol=0, atol=1e-10)
    assert command.synthesis_s == 0.0


# --- the named controllers and their settings ---


def test_paper_controller_has_the_full_friction_and_no_preload():
    paper = controllers(BOX.control)["paper"]
    assert (paper.friction_factor, paper.preload) == (1.0, 0.0)
    assert paper.feedforward
    assert replace(paper, friction_factor=0.8, preload=5.0) == BOX.control


def test_margin_controller_is_the_scenario_s_own_and_holds_more():
    margin = controllers(BOX.control)["margin"]
    assert margin == BOX.control
    assert margin.friction_factor < 1.0
    assert margin.preload > 0.0
    alone = {"solve_every": 1, "guard": UNGUARDED}
    grips = {
        name: controller(replace(control, **alone)).command(measured(71.0, GRIPPED_S)).w_commanded_C
        for name, control in controllers(BOX.control).items()
    }
    assert grips["paper"][:2, 2].max() < 1.0
    # The preload, up to the solver's tolerance.
    assert grips["margin"][:2, 2].min() > 5.0 - 1e-6


def test_no_feedforward_controller_differs_in_that_alone():
    without = controllers(BOX.control)["no-feedforward"]
    assert not without.feedforward
    assert replace(without, feedforward=True) == BOX.control


def test_controllers_keep_the_rest_of_a_scenario_s_control():
    own = Control(solve_every=7, objective=Objective.NORM_TORQUE)
    for name, control in controllers(own).items():
        # Fast tilts need forces at every step.
        assert control.solve_every == (1 if name == "dynamic" else 7)
        assert control.objective is Objective.NORM_TORQUE


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("friction_factor", 0.0),
        ("friction_factor", -0.5),
        ("friction_factor", 1.5),
        ("friction_factor", np.nan),
        ("preload", -1.0),
        ("preload", np.inf),
        ("preload", np.nan),
        ("bandwidth", -1.0),
        ("bandwidth", np.nan),
        ("pose_filter_s", -0.01),
        ("pose_filter_s", np.inf),
        ("pose_filter_s", np.nan),
        ("solve_every", 0),
        ("solve_every", -4),
        ("solve_every", 4.0),
        ("solve_every", True),
    ],
)
def test_a_senseless_control_setting_is_refused_by_name(field, value):
    with pytest.raises(InvalidInputError, match=rf"^control\.{field}: got {value}; valid is"):
        Control(**{field: value})


def test_settings_at_the_ends_of_their_ranges_are_accepted():
    Control(friction_factor=1.0, preload=0.0, bandwidth=0.0, solve_every=1)
