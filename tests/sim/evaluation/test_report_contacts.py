"""What counts of a contact that has let go, how shares are printed, and hands that come and go."""

import math
from dataclasses import replace

import pytest

from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.scenario.phases import Phase
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.render import to_markdown
from tests.helpers.short_run import (
    INFO,
    LAST,
    LEFT,
    LIMITS,
    PHASES,
    ROW,
    SCENARIO,
    TOUCH_ROW,
    changed,
    gap,
    judge_of,
    let_go,
    when,
)


def test_drift_after_a_contact_has_let_go_does_not_count(judge, run):
    def tampered(let_go):
        history = changed(run.history, "kept", (slice(let_go, None), LEFT), False)
        for field, value in (("slip", 0.3), ("slide", 0.5), ("spin", -1.0), ("utilisation", 7.0)):
            history = changed(history, field, (slice(ROW, None), LEFT), value)
        return judge.report(INFO, run.trace, history).contacts["left"]

    nominal = judge.report(INFO, run.trace, run.history).contacts["left"]
    left = tampered(ROW)
    assert left.kept_fraction == pytest.approx((ROW - 600) / 2100, abs=1e-12)
    for name in ("slip_mm", "slide_mm", "spin_deg", "max_utilisation"):
        assert 0.0 < getattr(left, name) <= getattr(nominal, name)
    # One step later it still had a hold when it drifted.
    late = tampered(ROW + 1)
    assert (late.slip_mm, late.slide_mm) == (300.0, 500.0)
    assert (late.spin_deg, late.max_utilisation) == (pytest.approx(math.degrees(1.0)), 7.0)


def test_a_contact_that_comes_back_does_not_count_again(judge, run):
    history = changed(run.history, "kept", (gap(ROW), LEFT), False)
    history = changed(history, "slip", (slice(ROW + 1, None), LEFT), 1.0)
    report = judge.report(INFO, run.trace, history)
    assert report.contacts["left"].slip_mm < LIMITS.slip_mm
    (sentence,) = report.sentences
    assert "let go" in sentence


def test_a_contact_that_was_never_there_has_finite_numbers(judge, run):
    history = changed(run.history, "kept", (slice(None), LEFT), False)
    left = judge.report(INFO, run.trace, history).contacts["left"]
    assert (left.kept_fraction, left.slip_mm, left.max_utilisation) == (0.0, 0.0, 0.0)


def test_a_few_lost_steps_are_not_printed_as_all(judge, run):
    trace, history = let_go(run.trace, run.history)
    report = judge.report(INFO, trace, history)
    assert report.contacts["edge_left"].kept_percent == 99.7
    assert report.contacts["left"].kept_percent == 100.0
    assert "| edge_left | 99.7 |" in to_markdown(report.page())
    assert "| left | 100.0 |" in to_markdown(report.page())


@pytest.mark.parametrize("final", [-1e-6, 1e-6])
def test_no_tilt_is_printed_as_minus_nothing(judge, run, final):
    report = judge.report(INFO, changed(run.trace, "tilt", LAST, final), run.history)
    assert any("ended at 0.00 deg instead of 10" in f for f in report.sentences)
    assert "\nTilt 0.00 of 10 deg" in to_markdown(report.page())
    # A tilt that is seen is.
    report = judge.report(INFO, changed(run.trace, "tilt", LAST, -0.01), run.history)
    assert any("ended at -0.57 deg instead of 10" in f for f in report.sentences)


# --- hands that come and go ---


def test_a_hand_that_hits_with_more_than_its_grip_is_told(judge, run):
    peak = run.trace.w_commanded_C[:, LEFT, N].max()
    history = changed(run.history, "w_measured_C", (TOUCH_ROW, LEFT, N), 1.001 * peak)
    (sentence,) = judge.report(INFO, run.trace, history).sentences
    assert sentence == (
        f"Hand left hit the object with {1.001 * peak:.3g} N at {when(run.trace, TOUCH_ROW)}, "
        f"more than its largest grip of {peak:.3g} N."
    )
    history = changed(run.history, "w_measured_C", (TOUCH_ROW, LEFT, N), 0.999 * peak)
    report = judge.report(INFO, run.trace, history)
    assert report.verdict is Verdict.PASS
    assert report.contacts["left"].free_normal_n == pytest.approx(0.999 * peak, rel=1e-12)


@pytest.mark.parametrize("gap", [0.01, 0.0])
def test_a_hand_that_touches_when_the_object_should_stand_alone_is_told(run, gap):
    # The same run, whose last phase is said to be one with hands off, or just without grip.
    stand = Phase("stand", 0.1, tilt=1.0, gap=gap, grip=0.0)
    scene = replace(SCENARIO, phases=(*PHASES[:3], replace(stand, name="let go", gap=0.0), stand))
    alone = judge_of(scene)
    trace = changed(run.trace, "phase", slice(2650, None), 4)
    found = alone.report(INFO, trace, run.history).sentences
    told = [f for f in found if "stand alone" in f]
    assert len(told) == (2 if gap else 0)
    if gap:
        expected = f"Hand left touched the object at {when(trace, 2650)}, when it should stand"
        assert told[0].startswith(expected)
        gone = changed(run.history, "w_measured_C", (slice(2650, None), slice(0, 2), N), 0.0)
        assert not [f for f in alone.report(INFO, trace, gone).sentences if "stand alone" in f]


def test_geoms_that_touched_are_told_with_the_time(judge, run):
    info = replace(INFO, collisions={("left_wrist", "post"): 1.2345})
    report = judge.report(info, run.trace, run.history)
    assert report.verdict is Verdict.FAIL
    assert report.sentences == ("left_wrist touched post at 1.23 s.",)
