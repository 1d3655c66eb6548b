"""Two runs of the same scene compared: what counts as agreement, and what does not."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.scenarios.cli import main
from fulcrum.sim.evaluation.failure import Category, Failure
from fulcrum.sim.evaluation.outcome import Outcome
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.plant import engines
from fulcrum.sim.plant.engines import Engine
from fulcrum.sim.run.crosscheck import (
    REFERENCE,
    Bounds,
    Variant,
    causes,
    compare,
    crosscheck,
    run_variant,
)
from fulcrum.sim.run.crosscheck_picture import draw_crosscheck
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.run.preparation import prepare
from fulcrum.sim.scenario.phases import stretched
from fulcrum.sim.world.world import NO_DEVIATION
from fulcrum.synthesis import InvalidInputError

BOX = scenario("box-tilt")
SHORT = replace(BOX, phases=stretched(BOX.phases, 2.0))
DRAKE = Variant(Engine.DRAKE)


@pytest.fixture(scope="module")
def request_():
    return Request(SHORT, "margin", best_effort=True)


@pytest.fixture(scope="module")
def result(request_):
    return execute(request_)


def changed(result, normal=1.0, **report):
    """The result with the hands' normal forces scaled, and another report."""
    wrenches = result.history.w_measured_C.copy()
    wrenches[:, :2, 2] *= normal
    history = replace(result.history, w_measured_C=wrenches)
    return replace(result, report=replace(result.report, **report), history=history)


def test_a_run_agrees_with_itself(result):
    found = compare(DRAKE, result, result, SHORT, Bounds())
    assert found.disagreements == ()
    assert all(c.normal_rms_n == c.tangential_rms_n == 0.0 for c in found.contacts.values())


@pytest.mark.parametrize(("factor", "agrees"), [(1.01, True), (1.1, False)])
def test_hands_agree_within_2_percent_of_their_peak(result, factor, agrees):
    found = compare(DRAKE, changed(result, factor), result, SHORT, Bounds())
    assert (found.disagreements == ()) is agrees
    share = found.contacts["left"].normal_share
    held = Schedule(SHORT).held[result.trace.phase.astype(int)]
    normal = result.history.w_measured_C[:, 0, 2]
    force = normal[held]
    assert share == pytest.approx((factor - 1.0) * np.sqrt(np.mean(force**2)) / normal.max())


def test_tilts_and_verdicts_that_differ_are_told(result):
    tilt = replace(result.report.tilt, final_deg=result.report.tilt.final_deg + 0.2)
    other = Verdict.FAIL if result.report.verdict is Verdict.PASS else Verdict.PASS
    failures = (Failure(3.0, Category.SLIP, "left", "Contact left slipped."),)
    found = compare(
        DRAKE, changed(result, tilt=tilt, verdict=other, failures=failures), result, SHORT, Bounds()
    )
    texts = " ".join(found.disagreements)
    assert "final tilt off by 0.200 deg" in texts
    assert f"verdict {other} instead of {result.report.verdict}" in texts


def test_two_failures_agree_if_they_have_a_cause_in_common(result):
    first, second, third = (
        changed(result, verdict=Verdict.FAIL, failures=(failure,))
        for failure in (
            Failure(3.38, Category.SLIP, "left", "Contact left slipped."),
            Failure(3.36, Category.SLIP, "right", "Contact right slipped."),
            Failure(9.0, Category.TILT, "", "The tilt ended at 0.00 deg."),
        )
    )
    assert causes(first.report) == causes(second.report) == {Category.SLIP}
    assert compare(DRAKE, second, first, SHORT, Bounds()).disagreements == ()
    assert "fails otherwise" in compare(DRAKE, third, first, SHORT, Bounds()).disagreements[0]


def test_outcomes_that_differ_are_told(result):
    dropped = changed(result, outcome=Outcome.DROPPED)
    (text,) = compare(DRAKE, dropped, result, SHORT, Bounds()).disagreements
    assert text == f"outcome dropped instead of {result.report.outcome}"


def test_half_the_step_gives_rows_at_the_scenarios_own(request_, result):
    prepared = prepare(SHORT, request_.settings, False)
    half = run_variant(request_, Variant(Engine.MUJOCO, 2), prepared)
    np.testing.assert_allclose(half.trace.t, result.trace.t, atol=1e-9)
    assert len(half.history.w_measured_C) == len(half.trace)
    assert np.abs(half.trace.q - result.trace.q).max() > 0.0


def test_a_missing_engine_is_told_before_anything_runs(monkeypatch, request_, capsys):
    monkeypatch.setattr(engines, "find_spec", lambda name: None)
    with pytest.raises(InvalidInputError, match="drake, which is not installed"):
        next(crosscheck(request_, {"nominal": (NO_DEVIATION, 0)}))
    assert main(["run", "box-tilt", "--engine", "drake"]) == 2
    assert "not installed" in capsys.readouterr().err
    assert main(["run", "box-tilt", "--engine", "ode"]) == 2


def test_a_short_run_in_both_engines(tmp_path, request_):
    pytest.importorskip("pydrake", reason="drake is not installed (pip install .[drake])")
    worlds = {"nominal": (NO_DEVIATION, 0)}
    (check,) = crosscheck(request_, worlds, (REFERENCE, DRAKE))
    assert [c.variant for c in check.comparisons] == [REFERENCE, DRAKE]
    drake = check.comparisons[1]
    tilts = [dataclasses.asdict(c.result.report.tilt) for c in check.comparisons]
    assert abs(tilts[0]["final_deg"] - tilts[1]["final_deg"]) < 0.1
    assert max(c.normal_rms_n for c in drake.contacts.values()) > 0.0
    draw_crosscheck("box-tilt", check, tmp_path / "check.png")
    assert (tmp_path / "check.png").stat().st_size > 10_000
