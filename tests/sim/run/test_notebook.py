"""What objects show in a notebook: names and units, whatever the names are, and without a crash."""

import html
import math
import re
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from fulcrum.scenarios import scenarios
from fulcrum.sim.evaluation.failure import Category, Failure
from fulcrum.sim.run.execute import Request, Result, execute
from fulcrum.sim.scenario.phases import Phase
from fulcrum.sim.sweep.farm import SweepResult
from fulcrum.sim.sweep.summary import FailureCause, Score
from fulcrum.synthesis import InfeasibleError, InvalidInputError, Objective, Synthesizer
from fulcrum.synthesis.markdown import escaped, number, table
from tests.helpers import problems
from tests.helpers.plans import fastest
from tests.helpers.short_run import SCENARIO, short_run

RENDERER = MarkdownIt("commonmark", {"html": True}).enable("table")
NASTY = ("a|b", "<script>", "_x_", "*", "`c`", "[l](u)", "$x$", "a\nb", "tau_1 & __y__", "~~s~~")


def cells(markdown):
    """Texts of the cells of all tables, as a renderer that people use shows them."""
    page = RENDERER.render(markdown)
    found = re.findall(r"<t[hd]\b[^>]*>(.*?)</t[hd]>", page, re.DOTALL)
    assert all("<" not in cell for cell in found), found
    return [html.unescape(cell) for cell in found]


def shown(thing):
    return thing._repr_markdown_()


# --- the parts ---


@pytest.mark.parametrize("name", NASTY)
def test_a_name_is_shown_as_it_is(name):
    assert " ".join(name.split()) in cells("\n".join(table(("name",), [(name,)])))


@given(st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1))
def test_any_printable_name_is_shown_as_it_is(name):
    assert cells("\n".join(table(("name",), [(name,)]))) == ["name", name]


@pytest.mark.parametrize("name", ["a|b", "<script>", "_x_", "*a*"])
def test_without_escaping_a_name_is_not_shown_as_it_is(name):
    unescaped = f"| name |\n|---|\n| {name} |"
    page = RENDERER.render(unescaped)
    assert html.unescape(re.findall(r"<td>(.*?)</td>", page)[0]) != name or "<script>" in page


def test_a_name_with_an_underscore_inside_stays_readable_as_text():
    assert escaped("edge_left") == "edge_left"


def test_numbers_are_short_and_what_is_not_there_is_empty():
    assert [number(x) for x in (math.pi, math.inf, -math.inf, math.nan)] == [
        "3.142",
        "∞",
        "-∞",
        "",
    ]


def test_a_table_without_rows_is_not_there():
    assert table(("a", "b"), []) == []


# --- the objects ---


def test_a_problem_shows_its_contacts_joints_and_units():
    problem = problems.box(joints=problems.arms())
    text = shown(problem)
    found = cells(text)
    assert {c.name for c in problem.contacts} <= set(found)
    assert all(joint in text for joint in problem.joints.names)
    assert {"e_n [m]", "f_n [N]", "place on the object [m]"} <= set(found)
    assert "force (0, 0, -20) N" in text
    assert "No joints" in shown(problems.box())


@pytest.mark.parametrize("objective", Objective)
def test_a_solution_shows_forces_by_name_and_its_proof(objective):
    solution = Synthesizer().solve(problems.box(joints=problems.arms(), objective=objective))
    text = shown(solution)
    found = cells(text)
    row = found.index("left")
    assert float(found[row + 1]) == pytest.approx(solution.wrench("left")[2], abs=5e-4)
    assert {"f_n [N]", "m_n [N·m]", "friction used [%]", "torque [N·m or N]"} <= set(found)
    assert "gap" in text
    worst = np.argmax(np.abs(solution.tau) / solution.problem.joints.tau_max)
    assert found[found.index("limit used [%]") + 1] == solution.problem.joints.names[worst]


def test_a_solution_without_joints_shows_no_joints():
    text = shown(Synthesizer().solve(problems.box()))
    assert "max-normal-force 27.2" in text
    assert "joint" not in text


def test_the_proof_that_there_are_no_forces_names_what_contradicts():
    with pytest.raises(InfeasibleError) as error:
        Synthesizer().solve(problems.box(environment=False, joints=problems.arms()))
    certificate = error.value.certificate
    text = shown(certificate)
    assert "No forces exist" in text
    assert cells(text)[2] == certificate.heaviest(1)[0]


@pytest.mark.parametrize("name", scenarios())
def test_a_scenario_shows_what_it_is(name):
    scene = scenarios()[name]
    text = shown(scene)
    found = cells(text)
    assert {*scene.contact_names, *(phase.name for phase in scene.phases)} <= set(found)
    assert {"takes [s]", "tilt [deg]", "gap [mm]"} <= set(found)
    assert f"{scene.object.mass * 9.81:.4g} N" in text


def test_names_that_markdown_would_read_are_shown_as_they_are():
    scene = replace(
        SCENARIO,
        name="a|b *c*",
        phases=(Phase("<b>|up", 1.0, tilt=1.0, gap=0.0, grip=0.0),),
        object=replace(SCENARIO.object, name="$x$"),
    )
    found = cells(shown(scene))
    assert "<b>|up" in found
    page = RENDERER.render(shown(scene))
    assert "a|b *c*" in page
    assert r"\$x\$" in shown(scene)


def test_a_run_shows_verdict_contacts_and_units():
    result = short_run()
    text = shown(result)
    assert text == shown(result.report)
    assert f"{SCENARIO.name}: PASS" in text
    found = cells(text)
    assert {*SCENARIO.contact_names, "slip [mm]", "force error [N]"} <= set(found)


def test_a_run_that_went_wrong_shows_why():
    result = short_run()
    failure = Failure(1.0, Category.LOST, "<left>", "The <left> let go.")
    failed = replace(result.report, failures=(failure,))
    text = shown(Result(failed, result.trace, result.history, "It diverged."))
    assert "- The &lt;left&gt; let go." in text
    assert "Ended by: It diverged." in text


def test_a_report_without_contacts_is_shown():
    report = replace(short_run().report, contacts={}, events=(), failures=())
    assert cells(shown(report)) == []


def test_a_plan_shows_duration_and_limits():
    plan = fastest("box-tilt")
    text = shown(plan)
    assert f"{plan.duration:.4f} s" in text
    assert {"tilt [deg]", "used at most [%]", "at [deg]"} <= set(cells(text))
    assert any("speed of" in cell for cell in cells(text))


def test_a_sweep_shows_rates_and_causes():
    cause = FailureCause("slip of left", 3, 0.3, "fulcrum run x")
    score = Score("margin", 10, 7, 0.7, 0.348, 0.933, 34.1, 36.0, 0.8, 0.2, (cause,))
    text = shown(SweepResult(pa.table({}), (score,)))
    found = cells(text)
    assert "70.0 (34.8 to 93.3)" in found
    assert "slip of left (3)" in found
    assert {"success (95 %) [%]", "grip [N]"} <= set(found)
    assert cells(shown(SweepResult(pa.table({}), ()))) == []


# --- what a request needs to be told ---


def test_a_request_needs_a_scenario_alone_and_refuses_unknown_controllers():
    request = Request(SCENARIO)
    assert (request.name, request.settings) == ("robust", Request(SCENARIO, "robust").settings)
    with pytest.raises(InvalidInputError, match=r"^controller: got pid; valid is one of robust"):
        Request(SCENARIO, "pid")


def test_settings_that_are_given_win_over_those_of_the_name():
    control = replace(SCENARIO.control, bandwidth=17.0)
    assert Request(SCENARIO, "paper", control).settings is control
    assert Request(SCENARIO, "paper").settings.friction_factor == 1.0


def test_a_run_by_name_is_the_run_with_those_settings():
    result = execute(Request(SCENARIO, "margin"))
    assert result.trace.tau.tobytes() == short_run().trace.tau.tobytes()
    assert result.report.controller == "margin"
