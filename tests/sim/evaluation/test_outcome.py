"""The outcome against motions whose end is known, at both sides of every bound."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.sim.evaluation.outcome import Outcome, fall_speed, gyration, measured_outcome
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.scenario.physics import Disturbed, Tolerances
from tests.helpers.faulty_runs import CASES, faulty_run
from tests.helpers.short_run import INFO, LAST, ROW, SCENARIO, changed, judge_of, short_run

RADIUS = gyration(SCENARIO.object)


def outcome(trace, scene=SCENARIO):
    return measured_outcome(scene, trace)


def moved(offset=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """The run, with the object elsewhere at its end."""
    trace = short_run().trace
    trace = changed(trace, "p_WO", LAST, trace.p_WO[LAST] + offset)
    R_WO = Rotation.from_rotvec(turn) * Rotation.from_quat(trace.quat_WO[LAST], scalar_first=True)
    return changed(trace, "quat_WO", LAST, R_WO.as_quat(scalar_first=True))


def fast(speed, rows):
    """The run, with the object moving along z for a while, on top of what it does."""
    twist = short_run().trace.twist_WO.copy()
    twist[rows, 2] += speed
    return replace(short_run().trace, twist_WO=twist)


def test_a_run_that_ends_at_its_target_has_completed():
    assert outcome(short_run().trace) is Outcome.COMPLETED


def test_the_radius_of_gyration_is_that_of_a_cuboid():
    # The box is 0.3 by 0.2 by 0.1 m.
    assert math.sqrt((0.3**2 + 0.2**2 + 0.1**2) / 12.0) == pytest.approx(RADIUS, rel=1e-9)


def test_an_object_that_has_been_brought_back_has_returned():
    trace = short_run().trace
    start = {n: getattr(trace, n)[0] for n in ("p_WO", "quat_WO", "tilt")}
    for name, value in start.items():
        trace = changed(trace, name, slice(ROW, None), value)
    assert outcome(trace) is Outcome.RETURNED


@pytest.mark.parametrize(("off_deg", "found"), [(1.9, Outcome.COMPLETED), (2.1, Outcome.RETURNED)])
def test_short_of_the_target_by_more_than_a_disturbed_run_may_be_is_returned(off_deg, found):
    path = object_path(SCENARIO.path)
    tilt = math.radians(SCENARIO.path.angle_deg - off_deg)
    R_WO, p_WO = path.pose(tilt)
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    trace = changed(short_run().trace, "tilt", LAST, tilt)
    trace = changed(changed(trace, "p_WO", LAST, p_WO), "quat_WO", LAST, quaternion)
    assert outcome(trace) is found
    wide = replace(SCENARIO, tolerances=Tolerances(disturbed=Disturbed(final_deg=3.0)))
    assert outcome(trace, wide) is Outcome.COMPLETED


@pytest.mark.parametrize(("share", "found"), [(0.19, "completed"), (0.21, "dropped")])
def test_an_object_that_has_slid_away_is_dropped(share, found):
    assert outcome(moved((share * RADIUS, 0.0, 0.0))) == found
    # Turned about the vertical, by as much of the radius about that.
    end = Rotation.from_quat(short_run().trace.quat_WO[LAST], scalar_first=True)
    axis_O = end.inv().apply([0.0, 0.0, 1.0])
    about = math.sqrt(axis_O @ SCENARIO.object.inertia_O @ axis_O / SCENARIO.object.mass)
    angle = 2.0 * math.asin(0.5 * share * RADIUS / about)
    assert outcome(moved(turn=(0.0, 0.0, angle))) == found


@pytest.mark.parametrize(("speed", "found"), [(0.14, "completed"), (0.16, "dropped")])
def test_an_object_that_falls_is_dropped_wherever_it_ends(speed, found):
    assert outcome(fast(speed, slice(400, 430))) == found  # at rest while grip is built up


@pytest.mark.parametrize(("speed", "found"), [(0.018, "completed"), (0.022, "dropped")])
def test_an_object_that_does_not_come_to_rest_is_dropped(speed, found):
    assert outcome(fast(speed, slice(-300, None))) == found
    # What jitters about its place rests.
    jitter = fast(0.1, slice(-300, None, 2))
    jitter.twist_WO[-299::2, 2] -= 0.1
    assert outcome(jitter) is Outcome.COMPLETED


def test_an_object_that_rests_while_the_arms_go_on_does_not_fall():
    trace, path = short_run().trace, object_path(SCENARIO.path)
    trace = changed(trace, "rate_ref", slice(None), 10.0)  # nothing can follow that
    assert fall_speed(path, SCENARIO.object, trace, 1e-3) < 0.1
    # One that is thrown does, though it lags behind the arms no more than the other.
    assert fall_speed(path, SCENARIO.object, fast(1.0, slice(400, 430)), 1e-3) > 0.9


def test_numbers_that_are_none_are_no_completed_run():
    assert outcome(changed(short_run().trace, "tilt", LAST, math.nan)) is Outcome.DROPPED


def test_interrupted_and_diverged_runs_are_called_so():
    run, judge = short_run(), judge_of(SCENARIO)

    def found(**info):
        return judge.report(replace(INFO, **info), run.trace, run.history).outcome

    assert found(interrupted=True) is Outcome.INTERRUPTED
    assert found(error="it diverged") is Outcome.DIVERGED
    assert found() is Outcome.COMPLETED


@pytest.mark.parametrize("name", CASES)
def test_the_guard_completes_returns_or_drops(name):
    reactions = CASES[name].reactions
    found = faulty_run(name).result.report.outcome
    if reactions[-1] == "run":
        assert found is Outcome.COMPLETED
    elif reactions[-1] == "end" or name.startswith("encoder"):
        assert found is Outcome.RETURNED
    else:  # the hands have let go, or lost it, in mid-tilt
        assert found is Outcome.DROPPED


def test_a_pass_has_completed():
    assert np.isclose(short_run().report.tilt.final_deg, SCENARIO.path.angle_deg, atol=0.1)
    assert short_run().report.outcome is Outcome.COMPLETED
