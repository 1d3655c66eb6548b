"""What counts as lost, where an object may end, and fingers that share a load across."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation import Checks, Verdict
from fulcrum.sim.evaluation.failure import Category
from fulcrum.sim.model import RobotModel, coupled_hands
from fulcrum.synthesis.arrays import N
from tests.helpers.short_run import INFO, LEFT, ROW, SCENARIO, changed, judge_of, short_run

# A shove sideways, as a hand that withdraws might give, and a turn on the spot.
SHOVE_M, TURN = 0.013, np.radians(10.0)


def judged(trace=None, history=None, disturbed=False):
    run = short_run()
    return judge_of(SCENARIO, disturbed).report(INFO, trace or run.trace, history or run.history)


def with_gap(steps):
    """The history of a run in which the left hand lets go for some steps."""
    return changed(short_run().history, "kept", (slice(ROW, ROW + steps), LEFT), False)


def test_a_gap_of_up_to_5_ms_is_reported_and_a_longer_one_is_a_failure():
    for steps in (1, 5):
        report = judged(history=with_gap(steps))
        assert report.verdict is Verdict.PASS, report.sentences
        assert report.contacts["left"].longest_gap_ms == pytest.approx(steps)
        assert report.contacts["left"].kept_percent < 100.0
    report = judged(history=with_gap(6))
    (failure,) = report.failures
    assert failure.category is Category.LOST
    assert failure.t == short_run().trace.t[ROW]  # where the gap began


def test_slip_after_a_short_gap_counts():
    history = changed(with_gap(2), "slip", (slice(ROW + 10, None), LEFT), 4e-4)
    report = judged(history=history)
    assert report.contacts["left"].slip_mm == pytest.approx(0.4)
    assert report.failures[0].cause == "slip left"


def moved(offset=(0.0, 0.0, 0.0), yaw=0.0):
    """The trace of a run at whose end the object is elsewhere."""
    trace = short_run().trace
    p, q = trace.p_WO.copy(), trace.quat_WO.copy()
    p[-1] += offset
    w, x, y, z = q[-1]
    c, s = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
    q[-1] = (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)
    return replace(trace, p_WO=p, quat_WO=q)


def test_an_object_that_ends_at_its_tilt_but_elsewhere_or_turned_fails():
    assert judged().tilt.final_mm < 0.1
    for trace in (moved((0.0, SHOVE_M, 0.0)), moved(yaw=TURN)):
        (failure,) = judged(trace).failures
        assert failure.category is Category.PLACE
    assert judged(moved((0.0, SHOVE_M, 0.0))).tilt.final_mm == pytest.approx(13.0, abs=0.1)
    assert judged(moved((0.0, 2e-4, 0.0))).verdict is Verdict.PASS


def test_fingers_of_one_wrist_are_coupled_and_two_arms_are_not():
    for name, groups in (("cylinder-tilt", ((0, 1),)), ("box-tilt", ()), ("panda-box", ())):
        scene = scenario(name)
        assert coupled_hands(scene, RobotModel(scene)) == groups


def test_coupled_hands_are_judged_by_the_friction_that_they_use_together():
    run, held = short_run(), slice(ROW, ROW + 20)
    history = changed(run.history, "utilisation", (held, LEFT), 1.0)
    robot = RobotModel(SCENARIO)
    apart, together = (
        Checks(SCENARIO, robot.joints, SCENARIO.tolerances, coupled) for coupled in ((), ((0, 1),))
    )
    report = judged()

    def found(checks, history):
        failures = checks.failures(INFO, run.trace, history, report.tilt, report.contacts)
        return [failure.cause for failure in failures]

    assert found(apart, history) == ["friction left"]
    # The right hand, at two thirds, presses as hard: together they use less than they may.
    assert history.w_measured_C[held, :2, N].min() > 0.0
    assert found(together, history) == []
    both = changed(history, "utilisation", (held, slice(0, 2)), 1.0)
    assert found(together, both) == ["friction left and right"]
