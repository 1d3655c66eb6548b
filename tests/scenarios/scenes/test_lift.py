"""Facts about scenarios that no forces can hold: refused before anything moves, or best effort."""

import json

import numpy as np
import pytest

from fulcrum.scenarios import scenarios
from fulcrum.scenarios.cli import main
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.run.preparation import UnholdableError
from fulcrum.sim.scenario.control import controllers
from fulcrum.sim.scenario.scenario import lifted

UNHOLDABLE = [s for s in scenarios().values() if not s.holdable]
HOLDABLE = [s for s in scenarios().values() if s.holdable]


def by_name(scenario):
    return scenario.name


@pytest.mark.parametrize("scenario", UNHOLDABLE, ids=by_name)
def test_a_lift_is_refused_with_the_reason_before_anything_is_written(scenario, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(UnholdableError, match=r"cannot be met within") as refused:
        execute(Request(scenario, "margin", scenario.control, out=out))
    assert not out.exists()
    explanation = refused.value.explanation
    assert not explanation.feasible
    assert explanation.conflict is not None and explanation.conflict.limits


@pytest.mark.parametrize("scenario", HOLDABLE, ids=by_name)
def test_what_can_be_held_cannot_be_lifted(scenario):
    # The paper's point for both of its examples, and the control of the test above: it is the
    # missing environment contact that makes the difference.
    with pytest.raises(UnholdableError):
        execute(Request(lifted(scenario), "margin", scenario.control))


@pytest.mark.parametrize("scenario", UNHOLDABLE, ids=by_name)
def test_the_full_friction_does_not_make_a_lift_feasible(scenario):
    with pytest.raises(UnholdableError):
        execute(Request(scenario, "paper", controllers(scenario.control)["paper"]))


def test_a_lift_gives_code_1_and_says_what_would_help(capsys, tmp_path):
    assert main(["run", "box-lift", "--out", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out
    for words in ("INFEASIBLE", "must change", "nothing has moved"):
        assert words in said


def test_a_lift_run_with_best_effort_fails_and_the_object_stays_below(tmp_path):
    out = tmp_path / "out"
    assert main(["run", "box-lift", "--best-effort", "--out", str(out)]) == 1
    report = json.loads((out / "report.json").read_text())
    assert report["verdict"] == "fail"
    # Every synthesis is best effort: none has a solution.
    assert report["synthesis"]["failures"] == report["synthesis"]["solves"] > 0
    assert any("found no forces" in failure["text"] for failure in report["failures"])
    assert abs(report["tilt"]["final_deg"]) < 5.0  # it lies where it lay, give or take a nudge
    assert report["torque"]["max_utilisation"] == pytest.approx(1.0)  # the arms give all they have


def test_best_effort_carries_part_of_the_weight():
    scenario = scenarios()["box-lift"]

    result = execute(Request(scenario, "margin", best_effort=True))
    trace, history = result.trace, result.history
    held = (trace.t > 3.3) & (trace.t < 3.7)  # with full grip, before the hands move up
    lift = trace.f_W[held][:, :2, 2].sum(axis=1)
    # explain: at most 60 % of the 20 N; as a command nearly all of that arrives.
    assert 9.0 < lift.mean() < 12.5
    assert np.isfinite(history.w_measured_C).all()
