"""Tolerances of disturbed runs: each is broken by what it is to catch, in time, and by no less."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.run.execute import Request
from fulcrum.sim.scenario.physics import Disturbed, Judged, Tolerances
from fulcrum.sim.signals.event import Cause, Event, Reaction
from fulcrum.sim.signals.trace import stretches
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import N
from tests.helpers.short_run import (
    EDGE_LEFT,
    GRIP_ROW,
    INFO,
    LAST,
    LEFT,
    ROW,
    SCENARIO,
    TOUCH_ROW,
    changed,
    gap,
    judge_of,
    short_run,
)

JOINTS = RobotModel(SCENARIO).joints


def judged(trace=None, history=None, scene=SCENARIO, disturbed=True, **info):
    run = short_run()
    judge = judge_of(scene, disturbed)
    report = judge.report(replace(INFO, **info), trace or run.trace, history or run.history)
    assert report.verdict is (Verdict.FAIL if report.failures else Verdict.PASS)
    assert report.disturbed is disturbed
    return [(failure.cause, round(1e3 * failure.t)) for failure in report.failures]


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
    lost = changed(short_run().history, "kept", (gap(ROW), LEFT), False)
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
    early = changed(short_run().history, "kept", (gap(GRIP_ROW), LEFT), False)
    assert judged(history=early) == []


def cut(rows):
    return changed(short_run().trace, "saturated", (rows, 3), 1.0)


def test_a_torque_may_be_cut_for_50_ms_at_a_stretch():
    assert judged(trace=cut(slice(ROW, ROW + 50))) == []
    # The tolerance is broken at the 51st step in a row.
    assert judged(trace=cut(slice(ROW, ROW + 51))) == [(f"saturated {JOINTS[3]}", ROW + 50)]
    apart = [*range(ROW, ROW + 40), *range(ROW + 41, ROW + 90)]
    assert judged(trace=cut(apart)) == []


def test_stretches_count_from_one_after_each_gap():
    assert stretches(np.array([0, 1, 1, 0, 1, 1, 1.0])).tolist() == [0, 1, 2, 0, 1, 2, 3]
    assert stretches(np.array([1.0, 1.0])).tolist() == [1, 2]


def ended(final_deg):
    return changed(short_run().trace, "tilt", LAST, np.radians(final_deg))


@pytest.mark.parametrize(
    ("final_deg", "found"),
    [(8.1, []), (7.9, ["tilt"]), (12.1, ["tilt"]), (math.nan, ["tilt", "dropped"])],
)
def test_the_tilt_must_end_within_2_deg(final_deg, found):
    assert judged(trace=ended(final_deg)) == [(text, LAST) for text in found]


def test_an_error_is_a_failure_and_the_first_in_time_comes_first():
    trace = changed(cut(slice(ROW, ROW + 60)), "tilt", LAST, 0.0)
    found = judged(trace=trace, error="it diverged")
    assert [text for text, _ in found] == [f"saturated {JOINTS[3]}", "error", "tilt"]


# What is not judged in a disturbed run unless it is asked for: how to break it, with which
# tolerance it is judged, and the cause that it then is.
STOPPED = Event(1.0, Cause.JOINT, Reaction.STOP, "a joint is off its path")
RUN = short_run
NOT_JUDGED = {
    "tracking": ({"error_deg": 0.2}, lambda: {"trace": off_by(0.3)}),
    "slide left": ({"slide_mm": 0.1}, lambda: {"history": history("slide", LEFT, 4e-4)}),
    "spin left": ({"spin_deg": 0.1}, lambda: {"history": history("spin", LEFT, 0.1)}),
    "friction left": (
        {"utilisation": 0.95},
        lambda: {"history": history("utilisation", LEFT, 1.5)},
    ),
    "force left": ({"force_error": 0.02}, lambda: {"trace": commanded(1.1, LEFT)}),
    "force edge_left": (
        {"support_force_error": 0.02},
        lambda: {"trace": commanded(1.1, EDGE_LEFT)},
    ),
    "lost edge_left": (
        {"support_lost_s": 0.0},
        lambda: {"history": history("kept", EDGE_LEFT, False)},
    ),
    "impact left": ({"impact": 1.0}, lambda: {"history": hit(1e3)}),
    "collision a and b": ({"collisions": True}, lambda: {"collisions": {("a", "b"): 1.5}}),
    "no-forces": (
        {"no_forces": True},
        lambda: {"trace": changed(RUN().trace, "failed", ROW, 1.0)},
    ),
    "given-up joint": ({"given_up": True}, lambda: {"events": (STOPPED,)}),
}


def off_by(deg):
    return changed(RUN().trace, "tilt", ROW, RUN().trace.tilt_ref[ROW] + np.radians(deg))


def history(field, contact, value):
    return changed(RUN().history, field, (slice(ROW, None), contact), value)


def commanded(factor, contact):
    force = RUN().trace.w_commanded_C[:, contact, N]
    return changed(RUN().trace, "w_commanded_C", np.s_[:, contact, N], factor * force)


def hit(force):
    return changed(RUN().history, "w_measured_C", (TOUCH_ROW, LEFT, N), force)


@pytest.mark.parametrize("cause", NOT_JUDGED)
def test_what_has_no_tolerance_is_not_judged_and_with_one_it_is(cause):
    tolerance, breaks = NOT_JUDGED[cause]
    assert judged(**breaks()) == []
    strict = replace(SCENARIO, tolerances=Tolerances(disturbed=Disturbed(**tolerance)))
    assert [found for found, _ in judged(scene=strict, **breaks())] == [cause]
    # A nominal run is held to it anyway, by the same check.
    assert cause in [found for found, _ in judged(disturbed=False, **breaks())]


def test_everything_that_is_not_judged_is_tried():
    ignored = {f.name for f in fields(Judged) if getattr(Disturbed(), f.name) in (math.inf, False)}
    assert {name for tolerance, _ in NOT_JUDGED.values() for name in tolerance} == ignored


@pytest.mark.parametrize("field", [field.name for field in fields(Judged)])
def test_tolerances_are_checked_when_made(field):
    if isinstance(getattr(Disturbed(), field), bool):
        return
    value = -1.0 if field.endswith("_s") else 0.0
    for bad in (value, math.nan):
        with pytest.raises(InvalidInputError, match=f"tolerances.{field}"):
            Tolerances(**{field: bad})


def test_a_run_counts_as_disturbed_where_its_world_is_not_as_believed():
    assert not Request(SCENARIO).judged_as_disturbed
    assert Request(SCENARIO, world=World(mass=1.1)).judged_as_disturbed
    assert not Request(SCENARIO, world=World(mass=1.1), disturbed=False).judged_as_disturbed
    assert Request(SCENARIO, disturbed=True).judged_as_disturbed
