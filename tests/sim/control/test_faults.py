"""Whatever breaks in mid-run, the loop holds, lowers or stops by the rule of the guard."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.scenarios.cli import main
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.scenario.control import Guard
from fulcrum.sim.signals.event import Mode
from fulcrum.sim.world.faults import Fault, FaultKind
from fulcrum.sim.world.presets import draw, preset
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.render import to_markdown
from tests.helpers.faulty_runs import CASES, TILT, UNGUARDED_TOO, faulty_run
from tests.helpers.recordings import NANOSECOND, Content

STEP = 0.001
# What counts as rest in the last 0.2 s [m/s or rad/s]: a light wrist that was turned away creeps
# back over seconds, for its damping is large against its impedance.
OBJECT_RESTS, JOINTS_REST = 0.02, 0.5
LOST_JOINTS = {"torque lost": "left_e0", "torque stuck": "left_e0"}


def robot_of(name):
    return RobotModel(CASES[name].scenario)


def unsafe(trace, robot):
    """The steps at which a torque was no number, or over its limit."""
    within = (robot.tau_min <= trace.tau) & (trace.tau <= robot.tau_max)
    return np.flatnonzero(~within.all(axis=1))


def restless(name, trace):
    """What still moves in the last 0.2 s, but for a joint whose motor does not do as it is told."""
    last = trace.rows(len(trace) - 200, len(trace))
    robot = robot_of(name)
    fast = np.abs(last.qd).max(axis=0) > JOINTS_REST
    moving = {robot.joints[i] for i in np.flatnonzero(fast)} - {LOST_JOINTS.get(name)}
    return moving | ({"object"} if np.abs(last.twist_WO).max() > OBJECT_RESTS else set())


@pytest.mark.parametrize("name", CASES)
def test_no_torque_is_ever_over_its_limit_or_no_number(name):
    trace, robot = faulty_run(name).result.trace, robot_of(name)
    assert unsafe(trace, robot).size == 0
    # One that is would be found.
    for value in (np.nan, 1.001 * robot.tau_max[0]):
        tau = trace.tau.copy()
        tau[1234, 0] = value
        np.testing.assert_array_equal(unsafe(replace(trace, tau=tau), robot), [1234])


@pytest.mark.parametrize("name", CASES)
def test_the_report_names_cause_time_and_reaction(name):
    _, cause, reactions, (earliest, latest), _ = CASES[name]
    report = faulty_run(name).result.report
    assert tuple(event.reaction for event in report.events) == reactions
    assert any(cause in event.text for event in report.events)
    assert earliest <= report.events[0].t <= latest
    times = [event.t for event in report.events]
    assert times == sorted(times)
    text = to_markdown(report.page())
    for event in report.events:
        assert f"| {event.t:.3f} | {event.text} | {event.reaction} |" in text
    given_up = [f for f in report.sentences if f.startswith("The run was ")]
    assert len(given_up) == len({"lower", "stop"} & set(reactions))
    if given_up:
        assert report.verdict is Verdict.FAIL


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if "end" in c.reactions])
def test_what_is_lowered_ends_where_it_lay_and_all_rests(name):
    trace = faulty_run(name).result.trace
    assert abs(np.degrees(trace.tilt[-1])) < 2.0
    # It slides by a few millimetres at most where arms were in the way.
    assert np.linalg.norm(trace.p_WO[-1] - trace.p_WO[0]) < 0.005
    assert restless(name, trace) == set()
    # The arms are back where they began, within what counts as on their path: one leans on a post.
    robot = robot_of(name)
    heavy = robot.tau_max >= 50.0 - 1e-9
    np.testing.assert_allclose(trace.q[-1][heavy], trace.q[0][heavy], rtol=0, atol=0.1)


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.reactions[-1] == "stop"])
def test_what_is_stopped_holds_still(name):
    trace = faulty_run(name).result.trace
    assert restless(name, trace) == set()
    # Where the hands still hold it, it stays; where they do not, it is down again.
    tilt_deg = np.degrees(trace.tilt)
    if name.startswith("encoder"):
        stopped = np.argmax(trace.mode == Mode.STOP)
        assert abs(tilt_deg[-1] - tilt_deg[stopped]) < 3.0
    else:
        assert abs(tilt_deg[-1]) < 2.0


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.reactions[-1] == "run"])
def test_what_passes_is_waited_for_and_the_tilt_completed(name):
    result, scene = faulty_run(name).result, CASES[name].scenario
    trace, path_s = result.trace, Schedule(scene).total_s
    assert abs(np.degrees(trace.tilt[-1]) - scene.path.angle_deg) < 0.1
    assert 1e3 * result.history.slip.max() < 0.1
    held = np.count_nonzero(trace.mode == Mode.HOLD) * STEP
    # The time that the path stood still, and half of the two ramps of 0.2 s.
    assert len(trace) * STEP == pytest.approx(path_s + held, abs=0.01)
    assert held > 0.2


@pytest.mark.parametrize("name", CASES)
def test_the_recording_is_complete_to_the_last_step(name):
    result, recording = faulty_run(name)
    content, trace = Content(recording), result.trace
    for entity in ("plots/tilt", "plots/torque", "plots/slip"):
        times, _ = content.series(entity, "Scalars:scalars")
        assert len(times) == len(trace)
        assert times[-1] == pytest.approx(trace.t[-1], abs=2 * NANOSECOND)
    assert content.text("verdict") == to_markdown(result.report.page())
    shown = [state for _, state in content.states("phase")]
    for reaction in {e.reaction for e in result.report.events} & {"hold", "lower", "stop"}:
        assert any(state.startswith(f"{reaction.upper()}: ") for state in shown)
    assert not any(state.startswith("RUN: ") for state in shown)


@pytest.mark.parametrize("name", UNGUARDED_TOO)
def test_without_the_guard_the_same_fault_ends_worse(name):
    with_it, without = faulty_run(name).result, faulty_run(name, guarded=False).result
    assert without.report.events == ()
    assert np.all(without.trace.mode == Mode.RUN)

    def worst_deg(trace):
        return np.degrees(np.abs(trace.tilt - trace.tilt_ref)).max()

    # With it the object lies where it lay; without, it is left standing or a hand goes astray.
    assert worst_deg(without.trace) > 3.0 * worst_deg(with_it.trace)
    assert abs(np.degrees(with_it.trace.tilt[-1])) < 0.01
    astray_m = without.history.slip.max()
    assert abs(np.degrees(without.trace.tilt[-1])) > 30.0 or astray_m > 0.1


def test_a_moment_s_silence_does_not_move_the_object_differently_after():
    spiked, clean = faulty_run("latency spike").result.trace, faulty_run("pose dead").result.trace
    # Until something breaks nothing differs.
    before = np.searchsorted(clean.t, 2.0)
    np.testing.assert_array_equal(spiked.tau[:before], clean.tau[:before])
    np.testing.assert_array_equal(spiked.mode[:before], Mode.RUN)


@pytest.mark.parametrize("seed", [2])
def test_a_harsh_world_in_which_the_grip_suffices_trips_nothing(seed):
    # In seed 2 an arm whose motors are weak sags by 6 deg on its way; it gets there all the same.
    box = scenario("box-tilt")
    firm = replace(box.control, friction_factor=0.6, preload=14.0)
    loop = closed_loop(box, firm, seed=seed, world=draw(preset("harsh"), box, seed))
    for _ in loop.run():
        assert loop.controller.events == ()
    assert np.degrees(loop.trace.tilt[-1]) > 89.0


def test_arms_at_a_limit_are_refused_before_anything_moves(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", "box-tilt", "--duration", "0.3", "--out", str(out)]) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert re.fullmatch(r"fulcrum: inverse kinematics cannot follow .* speed .*\n", errors)
    assert not out.exists()


@pytest.mark.parametrize(
    ("field", "options"),
    [
        ("fault.t", {"t": -1.0}),
        ("fault.t", {"t": np.nan}),
        ("fault.duration_s", {"duration_s": 0.0}),
        ("fault.duration_s", {"duration_s": np.nan}),
        ("fault.joint", {"kind": FaultKind.TORQUE_LOST}),
        ("fault.joint", {"joint": "left_s0"}),
        ("fault.extra_n", {"extra_n": 5.0}),
        ("fault.extra_n", {"kind": FaultKind.WEIGHT}),
        ("fault.kind", {"kind": "gremlins"}),
    ],
)
def test_a_senseless_fault_is_refused_by_name(field, options):
    with pytest.raises(InvalidInputError, match=rf"^{field}: got .*; valid is"):
        Fault(**{"kind": FaultKind.POSE_DEAD, "t": 1.0, **options})


def test_a_fault_of_a_joint_that_does_not_exist_is_refused():
    fault = Fault(FaultKind.TORQUE_LOST, 1.0, joint="tail")
    with pytest.raises(InvalidInputError, match=r"^fault\.joint: got tail; valid is one of right_"):
        closed_loop(TILT, TILT.control, world=World(faults=(fault,)))


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_senseless_threshold_is_refused_by_name(value):
    with pytest.raises(InvalidInputError, match=r"^guard\.tilt_error_deg: got .*; valid is"):
        Guard(tilt_error_deg=value)
