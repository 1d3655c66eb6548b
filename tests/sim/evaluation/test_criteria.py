"""Sweeps' criteria: each is broken by what it is to catch, at the right time, and by no less."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from fulcrum.sim.sweep.criteria import Criteria, violations

from fulcrum.sim.model.robot import RobotModel
from fulcrum.sim.signals.trace import stretches
from fulcrum.synthesis import InvalidInputError
from tests.helpers.short_run import (
    EDGE_LEFT,
    GRIP_ROW,
    LAST,
    LEFT,
    ROW,
    SCENARIO,
    changed,
    short_run,
)

JOINTS = RobotModel(SCENARIO).joints


def judged(trace=None, history=None, error=None, final_deg=None, criteria=None):
    run = short_run()
    report = run.report
    if final_deg is not None:
        report = replace(report, tilt=replace(report.tilt, final_deg=final_deg))
    result = replace(
        run,
        report=report,
        trace=trace or run.trace,
        history=history or run.history,
        error=error,
    )
    found = violations(criteria or Criteria(), SCENARIO, JOINTS, result)
    return [(violation.text, round(1e3 * violation.t)) for violation in found]


def test_a_run_that_keeps_to_everything_is_a_success():
    assert judged() == []


def slipped(contact, mm):
    return changed(short_run().history, "slip", (slice(ROW, None), contact), 1e-3 * mm)


@pytest.mark.parametrize(
    ("contact", "mm", "found"),
    [
        (LEFT, 4.9, []),
        (LEFT, 5.1, [("slip left", ROW)]),
        (EDGE_LEFT, 2.9, []),
        (EDGE_LEFT, 3.1, [("slip edge_left", ROW)]),
        (EDGE_LEFT, math.nan, [("slip edge_left", ROW)]),
    ],
)
def test_hands_may_slip_5_mm_and_supports_3_mm(contact, mm, found):
    assert judged(history=slipped(contact, mm)) == found


def test_a_hand_must_not_let_go_while_it_holds_and_its_slip_after_that_is_no_news():
    lost = changed(short_run().history, "kept", (ROW, LEFT), False)
    assert judged(history=lost) == [("lost left", ROW)]
    after = changed(lost, "slip", (slice(ROW, None), LEFT), 1.0)
    assert judged(history=after) == [("lost left", ROW)]
    before = changed(lost, "slip", (slice(ROW - 9, None), LEFT), 1.0)
    assert judged(history=before) == [("slip left", ROW - 9), ("lost left", ROW)]


def test_a_support_may_let_go_but_what_it_slips_meanwhile_counts():
    lost = changed(short_run().history, "kept", (slice(ROW, ROW + 9), EDGE_LEFT), False)
    assert judged(history=lost) == []
    assert judged(history=changed(lost, "slip", (ROW, EDGE_LEFT), 1.0)) == [("slip edge_left", ROW)]


def test_what_hands_do_before_full_grip_is_free():
    # Grip stands at 0.6 s.
    early = changed(short_run().history, "kept", (GRIP_ROW, LEFT), False)
    assert judged(history=early) == []


def cut(rows):
    return changed(short_run().trace, "saturated", (rows, 3), 1.0)


def test_a_torque_may_be_cut_for_50_ms_at_a_stretch():
    assert judged(trace=cut(slice(ROW, ROW + 50))) == []
    # The criterion is broken at the 51st step in a row.
    assert judged(trace=cut(slice(ROW, ROW + 51))) == [(f"saturated {JOINTS[3]}", ROW + 50)]
    apart = [*range(ROW, ROW + 40), *range(ROW + 41, ROW + 90)]
    assert judged(trace=cut(apart)) == []


def test_stretches_count_from_one_after_each_gap():
    assert stretches(np.array([0, 1, 1, 0, 1, 1, 1.0])).tolist() == [0, 1, 2, 0, 1, 2, 3]
    assert stretches(np.array([1.0, 1.0])).tolist() == [1, 2]


@pytest.mark.parametrize(
    ("final_deg", "found"), [(8.1, []), (7.9, ["tilt"]), (12.1, ["tilt"]), (math.nan, ["tilt"])]
)
def test_the_tilt_must_end_within_2_deg(final_deg, found):
    assert judged(final_deg=final_deg) == [(text, LAST) for text in found]


def test_an_error_is_a_failure_and_the_first_in_time_comes_first():
    found = judged(trace=cut(slice(ROW, ROW + 60)), error="it diverged", final_deg=0.0)
    assert [text for text, _ in found] == [f"saturated {JOINTS[3]}", "error", "tilt"]


@pytest.mark.parametrize("field", [field.name for field in fields(Criteria)])
def test_criteria_are_checked_when_made(field):
    with pytest.raises(InvalidInputError, match=f"criteria.{field}"):
        Criteria(**{field: 0.0})
