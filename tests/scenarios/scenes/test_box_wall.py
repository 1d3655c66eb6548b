"""The wall scene needs its wall, and ends where the box leans on it."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.scenario.contacts import Friction
from fulcrum.sim.scenario.control import controllers
from fulcrum.synthesis import InfeasibleError, Synthesizer
from fulcrum.synthesis.arrays import N
from tests.helpers.runs import run
from tests.helpers.short_run import INFO, judge_of

WALL = scenario("box-wall")
FOOT_LEFT = WALL.contact_names.index("foot_left")


def holdable(scene, controller, tilt_deg):
    """Whether forces exist; the arms' torques are no part of it."""
    problems = PathProblems(scene, controllers(scene.control)[controller], with_joints=False)
    try:
        Synthesizer().solve(problems.problem(tilt_deg))
    except InfeasibleError:
        return False
    return True


def without_wall(mu):
    """The scene on the table alone, with a friction."""
    foot = WALL.supports[:2]
    return replace(WALL, supports=tuple(replace(s, friction=Friction(mu)) for s in foot))


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0, 20.0])
def test_no_forces_tip_the_box_without_the_wall(tilt_deg):
    assert {s.surface for s in WALL.supports[:2]} == {"table"}
    mu = WALL.supports[0].friction.mu
    # Not even with the full friction and hands that need not press.
    assert not holdable(without_wall(mu), "paper", tilt_deg)
    assert holdable(WALL, "margin", tilt_deg)
    # It is the table that is too smooth: at the start a friction of 1.3 would do.
    assert holdable(without_wall(1.3), "paper", tilt_deg)


def test_the_box_ends_past_its_balance_with_its_face_on_the_wall():
    path, wall = object_path(WALL.path), WALL.supports[2]
    depth, _, height = WALL.object.shape.size
    assert path.end > np.arctan2(depth, height)
    # The outward normal of the far face, against the wall's.
    far = path.pose(path.end)[0] @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(far, np.negative(wall.normal_W), rtol=0, atol=1e-12)
    # A degree less is a gap at the top.
    R_WO, p_WO = path.pose(path.end - np.radians(1.0))
    top = p_WO + R_WO @ [depth / 2, 0.0, height / 2]
    gap = np.dot(np.subtract(top, WALL.path.point_W), wall.normal_W)
    assert gap == pytest.approx(height * np.sin(np.radians(1.0)), abs=1e-12)


def test_supports_at_one_place_are_judged_by_the_force_there():
    outcome = run("box-wall", "default")
    assert outcome.report.verdict is Verdict.PASS, outcome.report.sentences
    contacts, limits = outcome.report.contacts, WALL.tolerances
    # Alone the foot is far from its commanded force, and its friction is used up.
    peak = outcome.trace.w_commanded_C[:, FOOT_LEFT, N].max()
    assert contacts["foot_left"].force_error_rms_n > 2.5 * limits.support_force_error * peak
    assert contacts["foot_left"].max_utilisation > limits.utilisation
    # What is not there is missed, also where the wall would only have to take more.
    less = outcome.history.w_measured_C.copy()
    less[:, FOOT_LEFT, :3] *= 0.7
    history = replace(outcome.history, w_measured_C=less)
    (failure,) = judge_of(WALL).report(INFO, outcome.trace, history).sentences
    assert failure.startswith("Contacts foot_left and wall_left together followed")
