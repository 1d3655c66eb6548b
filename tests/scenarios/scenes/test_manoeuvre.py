"""The whole manoeuvre of every scenario: hands come, hold and go, and nothing else touches."""

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.synthesis.arrays import N
from tests.helpers.runs import BOX, NAMES, rows_of, run

# Scenarios whose hands are off at the end: what they leave must stand.
LEAVING = [name for name in NAMES if scenario(name).phases[-1].gap > 0.0]


def hand_forces(name, case="default"):
    """Normal forces of the hands, (k, n)."""
    return run(name, case).history.w_measured_C[:, : len(scenario(name).hands), N]


def free_rows(name, trace):
    """The steps at which no grip is asked for, from the grip at both ends of each phase."""
    grips = np.array([0.0, *(phase.grip for phase in scenario(name).phases)])
    return ((grips[1:] == 0.0) & (grips[:-1] == 0.0))[trace.phase.astype(int)]


def off_rows(name, trace):
    """The steps of phases in which hands are to stay away from first to last."""
    gaps = np.array([scenario(name).standoff, *(phase.gap for phase in scenario(name).phases)])
    return ((gaps[1:] > 0.0) & (gaps[:-1] > 0.0))[trace.phase.astype(int)]


@pytest.mark.parametrize("name", NAMES)
def test_phases_are_named_in_the_trace_and_the_report_in_their_order_and_time(name):
    report, trace, _ = run(name, "default")
    phases = scenario(name).phases
    assert [p.name for p in report.phases] == [p.name for p in phases]
    ends = np.cumsum([p.duration_s for p in phases])
    # The report says what the trace shows; the last step begins a step before the end.
    shown = [p.end_s for p in report.phases[:-1]]
    np.testing.assert_allclose(shown, ends[:-1], rtol=0, atol=0.00101)
    assert report.phases[-1].end_s == pytest.approx(ends[-1] - 0.001, abs=1e-6)
    changes = np.flatnonzero(np.diff(trace.phase))
    np.testing.assert_array_equal(np.diff(trace.phase)[changes], 1.0)
    # MuJoCo's time adds up steps, so that a border may be one step later.
    np.testing.assert_allclose(trace.t[changes + 1], ends[:-1], rtol=0, atol=0.00101)


@pytest.mark.parametrize("name", NAMES)
def test_no_hand_pushes_before_it_is_to_touch_or_after_it_has_withdrawn(name):
    trace, forces = run(name, "default").trace, hand_forces(name)
    off = off_rows(name, trace)
    assert off.any()
    np.testing.assert_array_equal(forces[off], 0.0)
    assert not trace.w_commanded_C[free_rows(name, trace)].any()
    # In the grip they do.
    assert forces[~free_rows(name, trace)].max() > 5.0


@pytest.mark.parametrize("name", NAMES)
def test_hands_touch_and_leave_with_less_than_their_grip(name):
    report, trace, _ = run(name, "default")
    forces, free = hand_forces(name), free_rows(name, trace)
    for i, hand in enumerate(scenario(name).hands):
        found = report.contacts[hand.name].free_normal_n
        assert found == forces[free, i].max()
        # Measured 0.87 N of 34 N (box).
        assert found <= trace.w_commanded_C[:, i, N].max()
        assert found < 0.1 * trace.w_commanded_C[:, i, N].max()


@pytest.mark.parametrize("name", NAMES)
def test_nothing_touches_against_the_scenario_s_will(name):
    report, trace, _ = run(name, "default")
    assert not trace.collisions.any()
    assert not [f for f in report.sentences if "touched" in f]


@pytest.mark.parametrize("name", LEAVING)
def test_what_the_hands_leave_is_at_its_final_tilt_and_at_rest_for_a_second(name):
    _, trace, _ = run(name, "default")
    last = trace.rows(len(trace) - 1000, len(trace))
    target = scenario(name).path.angle_deg * scenario(name).phases[-1].tilt
    assert np.abs(np.degrees(last.tilt) - target).max() <= scenario(name).tolerances.final_deg
    # Measured 2e-13 m/s and 7e-15 rad/s (box).
    assert np.abs(last.twist_WO).max() < 1e-4
    np.testing.assert_array_equal(hand_forces(name)[-1000:], 0.0)
    # A moving object is caught.
    moving = rows_of(name, trace, "tilt")
    assert np.abs(trace.twist_WO[moving]).max() > 1e-2


@pytest.mark.parametrize("name", LEAVING)
def test_the_last_phase_is_with_hands_off(name):
    _, trace, history = run(name, "default")
    last = trace.phase == len(scenario(name).phases) - 1
    hands = len(scenario(name).hands)
    assert not history.kept[last, :hands].any()
    # A round end stands on any points of its rim, an edge on its ends.
    assert len(scenario(name).supports) == 1 or history.kept[last, hands:].all()


# --- what must be caught ---


def test_a_hand_that_hits_too_hard_is_caught():
    report, trace, _ = run(BOX, "hard")
    forces = hand_forces(BOX, "hard")[trace.phase <= 1]
    peak = trace.w_commanded_C[:, :2, N].max(axis=0)
    assert (forces.max(axis=0) > peak).all()
    assert report.verdict is Verdict.FAIL
    told = [f for f in report.sentences if "hit the object with" in f]
    assert [f.split()[1] for f in sorted(told)] == ["left", "right"]
    assert f"{forces[:, 0].max():.3g} N" in sorted(told)[0]


def test_a_hand_that_still_touches_at_the_end_is_caught():
    report = run(BOX, "clinging").report
    assert report.verdict is Verdict.FAIL
    assert [f for f in report.sentences if "touched the object at" in f and "stand alone" in f]
    assert len(report.sentences) <= 2


def test_hands_that_withdraw_without_having_tilted_pass():
    report, trace, _ = run(BOX, "leaving")
    assert report.verdict is Verdict.PASS, report.sentences
    assert report.tilt.target_deg == 0.0
    assert np.abs(np.degrees(trace.tilt)).max() < 0.1


def test_an_obstacle_that_the_belief_does_not_know_is_told_with_both_names_and_the_time():
    report, trace, _ = run(BOX, "blocked")
    assert report.verdict is Verdict.FAIL
    first = float(trace.t[np.flatnonzero(trace.collisions)[0]])
    told = [f for f in report.sentences if "touched" in f]
    assert "post" in told[0]
    assert "left_" in told[0]
    assert told[0].endswith(f"at {first:.2f} s.")
    assert 0.0 < first < 2.3  # while the hands come, before they grip
