"""Facts about the paper's figures and numbers as they are reproduced."""

import csv

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.scenarios.paper.cases import (
    FORCE_OBJECTIVES,
    TORQUE_OBJECTIVES,
    paper_cylinder,
    tilt_curve,
)
from fulcrum.scenarios.paper.figures import Curve, Figure, draw
from fulcrum.scenarios.paper.reproduce import closed_loop, grip_error
from fulcrum.scenarios.paper.statements import all_statements
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.scenario.control import controllers
from fulcrum.synthesis import Objective

TILTS = np.arange(0.0, 90.5, 1.0)


@pytest.fixture(scope="module")
def statements():
    from dataclasses import replace

    box, cylinder = scenario("box-tilt"), paper_cylinder()
    exact = controllers(box.control)["paper"]
    box_curves = {
        name: tilt_curve(PathProblems(box, replace(exact, objective=objective)), TILTS)
        for name, objective in (FORCE_OBJECTIVES | TORQUE_OBJECTIVES).items()
    }
    exact = controllers(cylinder.control)["paper"]
    cylinder_curves = {
        name: tilt_curve(PathProblems(cylinder, replace(exact, objective=o), False), TILTS[:86])
        for name, o in FORCE_OBJECTIVES.items()
    }
    return {s.statement: s for s in all_statements(box_curves, cylinder_curves)}


def test_what_the_paper_states_is_reproduced_but_for_two_numbers(statements):
    missed = [
        s.statement for s in statements.values() if s.reproduced is not None and not s.reproduced
    ]
    assert missed == [
        "lift-off without torque limits",
        "largest joint torque is at elbow joint 3 or 4",
    ]
    assert all(s.reason for s in statements.values())
    # Times on another machine are set side by side, and neither reproduced nor missed.
    assert [s.paper for s in statements.values() if s.reproduced is None] == [
        "1.15 s",
        "2.23 s",
        "2.41 s",
    ]


def test_the_numbers_are_the_ones_of_the_reading_notes(statements):
    ours = {name: s.ours for name, s in statements.items()}
    grip = statements["largest grip while tilting the box, at 0 deg"]
    assert float(grip.ours.split()[0]) == pytest.approx(27.221, abs=0.005)
    assert "27.245 N" in grip.reason
    lift = statements["lift-off without torque limits"]
    assert float(lift.ours.split()[0]) == pytest.approx(101.1, abs=0.1)
    assert "it is 52.97 N" in lift.reason  # what the paper's number takes
    end = statements["results are shown up to 85 deg with 30 N per finger"].ours
    assert end.startswith("feasible to 85.3")
    assert "29.57 N at 85 deg" in end  # 29.6 +- 0.1
    assert ours["variables of the cylinder, GFOP"] == "11"
    assert ours["variables of the box, GFOP"] == "14"
    assert ours["variables of the box, TOP"] == "28"


@pytest.mark.parametrize("name", ["box-tilt", "cylinder-tilt"])
def test_measured_grip_follows_the_computed_curve_within_3_percent(name):
    loop = closed_loop(scenario(name), Objective.MAX_NORMAL_FORCE)
    errors = [grip_error(loop, hand) for hand in range(2)]
    assert max(errors) <= 0.03
    # The other hand's or a shifted curve is caught: the measure can fail.
    shifted = type(loop)(
        measured=loop.measured,
        computed=type(loop.computed)(
            loop.computed.tilt_deg + 5.0,
            loop.computed.normal,
            loop.computed.torque,
            loop.computed.solve_s,
        ),
    )
    assert max(grip_error(shifted, hand) for hand in range(2)) > 0.03


def test_an_infeasible_tilt_leaves_a_gap_and_no_number():
    cylinder = paper_cylinder()
    exact = controllers(cylinder.control)["paper"]
    found = tilt_curve(PathProblems(cylinder, exact, False), [84.0, 85.0, 86.0, 87.0])
    assert list(found.tilt_deg) == [84.0, 85.0]


def test_a_figure_is_a_picture_and_a_table_of_the_same_numbers(tmp_path):
    x = np.linspace(0.0, 90.0, 4)
    figure = Figure("figure-0", "A line", "force [N]", "caption", [Curve("line", x, 2.0 * x)])
    draw(figure, tmp_path)
    assert (tmp_path / "figure-0.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "figure-0.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["curve", "tilt_deg", "force [N]"]
    np.testing.assert_allclose(
        [[float(v) for v in row[1:]] for row in rows[1:]], np.column_stack([x, 2 * x])
    )
