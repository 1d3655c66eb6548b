"""The verdict: tampered runs fail in words that name the contact, the time and the tilt."""

import json
import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.synthesis.arrays import N
from tests.helpers.short_run import (
    EDGE_LEFT,
    GRIP_ROW,
    INFO,
    LAST,
    LEFT,
    LIMITS,
    RIGHT,
    ROW,
    SCENARIO,
    changed,
    gap,
    let_go,
    when,
)

REPORT_KEYS = {
    "": "scenario controller objective seed disturbed verdict outcome failures events phases tilt"
    " contacts torque synthesis timing recording",
    "tilt": "target_deg final_deg final_mm rms_error_deg max_error_deg",
    "contacts": "left right edge_left edge_right",
    "contacts.left": "kept_fraction slip_mm slide_mm spin_deg max_utilisation max_normal_n"
    " force_error_rms_n free_normal_n longest_gap_ms",
    "torque": "max_utilisation joint saturated_fraction",
    "synthesis": "solves failures p50_us p99_us",
    "timing": "sim_s wall_s real_time_factor",
}


def joint_index(name):
    return RobotModel(SCENARIO).joints.index(name)


# One tampering each: what is changed in (trace, history), and the sentence that must come of it.
# Those that last to the end set all rows from ROW on.
def slipped(trace, history):
    return trace, changed(history, "slip", (slice(ROW, None), LEFT), 4.0e-4)


def slid(trace, history):
    return trace, changed(history, "slide", (slice(ROW, None), RIGHT), 6.0e-4)


def spun(trace, history):
    return trace, changed(history, "spin", (slice(ROW, None), LEFT), -np.radians(0.2))


def overused(trace, history):
    return trace, changed(history, "utilisation", (ROW, RIGHT), 0.97)


def tilted_off(trace, history):
    return changed(trace, "tilt", ROW, trace.tilt_ref[ROW] + np.radians(0.3)), history


def ended_off(trace, history):
    # 0.15 deg is inside the tolerance for errors on the way and outside that for the end.
    return changed(trace, "tilt", LAST, np.radians(10.15)), history


def cut(trace, history):
    return changed(trace, "saturated", (ROW, joint_index("left_e1")), 1.0), history


def found_no_forces(trace, history):
    return changed(trace, "failed", [ROW, ROW + 4], 1.0), history


def followed_badly(trace, history):
    commanded = trace.w_commanded_C[:, LEFT, N]
    return changed(trace, "w_commanded_C", np.s_[:, LEFT, N], 1.1 * commanded), history


SENTENCES = {
    let_go: "Contact edge_left let go at {when}; it was lost in 6 of 2100 steps.",
    slipped: "Contact left slipped more than the allowed 0.2 mm at {when}; 0.4 mm in all.",
    slid: "Contact right slid more than the allowed 0.2 mm at {when}; 0.6 mm in all.",
    spun: "Contact left spun more than the allowed 0.1 deg at {when}.",
    overused: "Contact right used 97 % of its friction (allowed 95 %), first at {when}.",
    tilted_off: "The tilt was off by more than the allowed 0.2 deg at {when}; 0.3 deg at worst.",
    ended_off: "The tilt ended at 10.15 deg instead of 10 +- 0.1 deg.",
    cut: "Torques were cut in 1 of 2700 steps, first that of left_e1 at {when}.",
    found_no_forces: "The synthesis found no forces 2 times, first at {when}.",
}


def numbers(value):
    """All numbers in nested dictionaries and lists."""
    if isinstance(value, dict):
        return [x for item in value.values() for x in numbers(item)]
    if isinstance(value, (list, tuple)):
        return [x for item in value for x in numbers(item)]
    return [value] if isinstance(value, (int, float)) else []


def test_the_run_passes_before_it_is_tampered_with(judge, run):
    report = judge.report(INFO, run.trace, run.history)
    assert report.verdict is Verdict.PASS
    assert report.sentences == ()


@pytest.mark.parametrize("tamper", SENTENCES, ids=lambda t: t.__name__)
def test_exactly_the_failure_is_told(judge, run, tamper):
    trace, history = tamper(run.trace, run.history)
    report = judge.report(INFO, trace, history)
    assert report.verdict is Verdict.FAIL
    assert report.sentences == (SENTENCES[tamper].format(when=when(trace, ROW)),)


def test_a_normal_force_off_its_command_is_told_with_both_numbers(judge, run):
    trace, history = followed_badly(run.trace, run.history)
    (sentence,) = judge.report(INFO, trace, history).sentences
    settled = trace.t > 0.5995
    error = (history.w_measured_C[:, LEFT, N] - trace.w_commanded_C[:, LEFT, N])[settled]
    allowed = LIMITS.force_error * trace.w_commanded_C[:, LEFT, N].max()
    assert sentence == (
        f"Contact left followed its commanded normal force only to {np.sqrt(np.mean(error**2)):.3g}"
        f" N RMS (allowed {allowed:.3g} N)."
    )


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_slip_just_inside_its_tolerance_passes_and_just_outside_fails(judge, run, share):
    slip = 1e-3 * share * LIMITS.slip_mm
    history = changed(run.history, "slip", (slice(ROW, None), LEFT), slip)
    verdict = judge.report(INFO, run.trace, history).verdict
    assert verdict is (Verdict.PASS if share < 1.0 else Verdict.FAIL)


def test_while_grip_is_built_up_contacts_are_not_held_to_account(judge, run):
    history = changed(run.history, "kept", (gap(GRIP_ROW), EDGE_LEFT), False)
    history = changed(history, "utilisation", (GRIP_ROW, LEFT), 1.0)
    assert judge.report(INFO, run.trace, history).verdict is Verdict.PASS
    # The same at the first step after it is a failure.
    history = changed(run.history, "kept", (gap(600), EDGE_LEFT), False)
    assert judge.report(INFO, run.trace, history).verdict is Verdict.FAIL


def test_torques_are_held_to_account_while_grip_is_built_up(judge, run):
    trace = changed(run.trace, "saturated", (GRIP_ROW, 0), 1.0)
    (sentence,) = judge.report(INFO, trace, run.history).sentences
    assert sentence.endswith("at 0.40 s (tilt 0.0 deg).")


def test_sentences_stand_in_the_order_of_time(judge, run):
    def told(slip_row, cut_row, loss_row):
        history = changed(run.history, "slip", (slice(slip_row, None), LEFT), 4e-4)
        history = changed(history, "kept", (gap(loss_row), RIGHT), False)
        trace = changed(run.trace, "saturated", (cut_row, 0), 1.0)
        return [
            next(word for word in ("slipped", "cut", "let go") if word in sentence)
            for sentence in judge.report(INFO, trace, history).sentences
        ]

    assert told(600, 1200, 1800) == ["slipped", "cut", "let go"]
    assert told(1800, 1200, 600) == ["let go", "cut", "slipped"]


def test_what_a_contact_does_after_it_has_let_go_is_no_news(judge, run):
    history = changed(run.history, "kept", (slice(ROW, None), LEFT), False)
    history = changed(history, "slip", (slice(ROW + 100, None), LEFT), 1.0)
    history = changed(history, "utilisation", (slice(ROW + 100, None), LEFT), 1.0)
    (sentence,) = judge.report(INFO, run.trace, history).sentences
    assert sentence.startswith("Contact left let go")
    # Before it, it is.
    history = changed(history, "slip", (slice(ROW - 100, None), LEFT), 1.0)
    assert "slipped" in judge.report(INFO, run.trace, history).sentences[0]


def test_an_interrupted_run_is_neither_pass_nor_fail(judge, run):
    trace, history = run.trace.rows(0, 1000), slipped(run.trace, run.history)[1]
    history = replace(history, **{name: a[:1000] for name, a in vars(history).items()})
    report = judge.report(replace(INFO, interrupted=True), trace, history)
    assert report.verdict is Verdict.INTERRUPTED
    assert report.sentences == ("The run was interrupted at 1.00 s.",)
    assert judge.report(INFO, trace, history).verdict is Verdict.FAIL


def test_an_error_that_ended_the_run_fails_it(judge, run):
    error = "The simulation diverged at 2499 steps: mjWARN_BADQACC."
    report = judge.report(replace(INFO, error=error), run.trace, run.history)
    assert report.verdict is Verdict.FAIL
    assert report.sentences == (error,)


@pytest.mark.parametrize("steps", [1, 100, 700, 2700])
def test_every_number_of_the_report_is_finite(judge, run, steps):
    # 1 and 100 steps: before grip is built up, and before the first synthesis has company.
    trace = run.trace.rows(0, steps)
    history = replace(run.history, **{name: a[:steps] for name, a in vars(run.history).items()})
    content = asdict(judge.report(INFO, trace, history))
    assert all(math.isfinite(x) for x in numbers(content))
    assert json.loads(json.dumps(content, allow_nan=False)) == json.loads(json.dumps(content))


def test_a_number_that_is_not_finite_is_found():
    assert not all(math.isfinite(x) for x in numbers({"a": [{"b": (1.0, math.nan)}]}))
    assert numbers({"a": [1, {"b": 2.5}], "c": "3"}) == [1, 2.5]


@pytest.mark.parametrize("part", REPORT_KEYS)
def test_the_report_has_all_promised_keys(judge, run, part):
    content = json.loads(json.dumps(asdict(judge.report(INFO, run.trace, run.history))))
    for key in filter(None, part.split(".")):
        content = content[key]
    assert list(content) == REPORT_KEYS[part].split()


def test_the_report_s_numbers_are_those_of_the_trace(judge, run):
    trace, history = run.trace, run.history
    report = judge.report(INFO, trace, history)
    settled = trace.t > 0.5995
    assert report.tilt.final_deg == np.degrees(trace.tilt[-1])
    error = np.degrees(trace.tilt - trace.tilt_ref)
    assert report.tilt.max_error_deg == np.abs(error).max()
    left = report.contacts["left"]
    assert left.slip_mm == 1e3 * history.slip[settled, LEFT].max()
    assert left.max_normal_n == history.w_measured_C[settled, LEFT, N].max()
    assert report.synthesis.solves == np.count_nonzero(trace.synthesis_s)
    assert report.seed == INFO.seed
    # 2700 steps of 1 ms in the 2 s that INFO says they took.
    assert report.timing.real_time_factor == pytest.approx(1.35, rel=1e-12)
    touching = trace.t < 0.1995
    assert left.free_normal_n == history.w_measured_C[touching, LEFT, N].max()


def test_phases_are_named_in_order_with_their_times(judge, run):
    phases = judge.report(INFO, run.trace, run.history).phases
    assert [p.name for p in phases] == ["touch", "grip", "tilt", "hold"]
    # A phase is seen to begin at the first row of it, a step after its start at most.
    expected = [(0.0, 0.2), (0.2, 0.6), (0.6, 2.6), (2.6, 2.699)]
    np.testing.assert_allclose([(p.start_s, p.end_s) for p in phases], expected, atol=1.001e-3)
    history = replace(run.history, **{name: a[:1000] for name, a in vars(run.history).items()})
    begun = judge.report(INFO, run.trace.rows(0, 1000), history).phases
    assert [p.name for p in begun] == ["touch", "grip", "tilt"]
    assert begun[-1].end_s == pytest.approx(0.999, abs=1e-9)
