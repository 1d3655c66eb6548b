"""The planned path keeps the tips where the phases ask for, and all limits."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.scene import tip_geom, tip_site
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.synthesis import InvalidInputError
from tests.helpers.postures import asked, between, on_grid, planned, posed, posed_model, tampered
from tests.helpers.runs import NAMES

# Inverse kinematics stops at a pose error of 1e-9; orientation counts at the lever of the tip.
ON_GRID = 1e-8
# A cubic spline through steps of h = 1 deg leaves h^4 / 384 times a fourth derivative of ~100 rad
# at 1 m, and more near its ends. Measured: 3e-8.
BETWEEN = 1e-6

each_scenario = pytest.mark.parametrize("name", NAMES)


def tip_errors(name, path, where):
    """Largest error of the tips' centres [m] and of their axes [-] at phases and progresses."""
    scene, model = scenario(name), posed_model(name)
    positions, axes = [], []
    for index, progress in where:
        tilt, gap = asked(path.schedule, index, progress)
        data = posed(scene, model, path.at(index, progress)[0], tilt)
        thing = data.body(scene.object.name)
        R_WO = thing.xmat.reshape(3, 3)
        for hand in scene.hands:
            normal, tangent = R_WO @ hand.normal_O, R_WO @ hand.tangent_O
            radius = model.geom(tip_geom(hand)).size[0]
            tip = data.site(tip_site(hand))
            expected = thing.xpos + R_WO @ hand.p_OC_O - (radius + gap) * normal
            positions.append(tip.xpos - expected)
            tip_axes = tip.xmat.reshape(3, 3)
            axes.append(tip_axes - np.column_stack([tangent, np.cross(normal, tangent), normal]))
    return float(np.abs(positions).max()), float(np.abs(axes).max())


def coarse(path, phase, stride):
    """The path through every so many points of one phase's grid."""

    def thinned(arrays):
        return tuple(a[::stride] if i == phase else a for i, a in enumerate(arrays))

    return replace(path, progress=thinned(path.progress), q=thinned(path.q))


# --- the path is followed ---


@each_scenario
def test_tips_are_where_the_phases_ask_for_at_every_point_of_the_grids(name):
    path = planned(name)
    position, axis = tip_errors(name, path, on_grid(path))
    assert position < ON_GRID
    assert axis < ON_GRID
    # A ten-millionth of a radian is caught.
    position, axis = tip_errors(name, tampered(path, 1e-7), on_grid(path))
    assert position > ON_GRID
    assert axis > ON_GRID


@each_scenario
def test_tips_are_where_the_phases_ask_for_between_the_points_of_the_grids(name):
    path = planned(name)
    position, axis = tip_errors(name, path, between(path))
    assert position < BETWEEN
    assert axis < BETWEEN
    # The tilt with a fifth of its grid is caught.
    tilting = int(np.argmax([len(x) for x in path.progress]))
    where = [(i, x) for i, x in between(path) if i == tilting][:200]
    assert tip_errors(name, path, where)[0] < BETWEEN
    assert tip_errors(name, coarse(path, tilting, 5), where)[0] > BETWEEN


@each_scenario
def test_grids_span_their_phases_in_steps_of_a_degree_and_5_mm_at_most(name):
    path = planned(name)
    assert len(path.progress) == len(path.q) == len(scenario(name).phases)
    for index, grid in enumerate(path.progress):
        assert (grid[0], grid[-1]) == (0.0, 1.0)
        tilts, gaps = np.array([asked(path.schedule, index, x) for x in grid]).T
        assert np.degrees(np.abs(np.diff(tilts))).max() < 1.0 + 1e-9
        assert np.abs(np.diff(gaps)).max() < 0.005 + 1e-9


@each_scenario
def test_slope_is_the_derivative_by_the_progress(name):
    path, h = planned(name), 1e-5
    where = [(i, x) for i, x in between(path) if h < x < 1.0 - h]
    ends = [np.array([path.at(i, x + d)[0] for i, x in where]) for d in (-h, h)]
    difference = (ends[1] - ends[0]) / (2.0 * h)
    slope = np.array([path.at(i, x)[1] for i, x in where])
    # Rounding over 2 h is 1e-11; a third derivative by the progress, of some 100 rad, times h^2 / 6
    # is 2e-9, and its jumps between the spline's pieces are as large.
    np.testing.assert_allclose(slope, difference, rtol=0, atol=1e-8)
    late = np.array([path.at(i, x + 1e-4)[1] for i, x in where])
    assert np.abs(late - difference).max() > 1e-6


@each_scenario
def test_planning_twice_gives_the_same_path_bit_for_bit(name):
    again = plan_joints(scenario(name))
    for q, expected in zip(again.q, planned(name).q, strict=True):
        np.testing.assert_array_equal(q, expected)


# --- from phase to phase ---


def jumps(path):
    """Largest difference of postures over the phases' borders [rad or m]."""
    count = len(path.progress)
    return max(np.abs(path.at(i + 1, 0.0)[0] - path.at(i, 1.0)[0]).max() for i in range(count - 1))


@each_scenario
def test_postures_are_continuous_over_the_phases_borders(name):
    path = planned(name)
    # The same numbers, through splines that interpolate: a few roundings.
    assert jumps(path) < 1e-14
    first = tuple(q + 1e-9 * (i == 1) for i, q in enumerate(path.q))
    assert jumps(replace(path, q=first)) > 0.9e-9


@each_scenario
def test_arms_rest_in_phases_that_ask_for_no_motion(name):
    path = planned(name)
    resting = 0
    for index, phase in enumerate(scenario(name).phases):
        previous = path.schedule.before(index)
        if (previous.tilt, previous.gap) == (phase.tilt, phase.gap):
            resting += 1
            assert np.ptp(path.q[index], axis=0).max() < 1e-9
        else:
            assert np.ptp(path.q[index], axis=0).max() > 1e-3
    assert resting


def distances(name, index, progress):
    """Of the hands' tips from the geoms that they touch [m], by MuJoCo."""
    scene, model = scenario(name), posed_model(name)
    path = planned(name)
    tilt, _ = asked(path.schedule, index, progress)
    data = posed(scene, model, path.at(index, progress)[0], tilt)
    return np.array(
        [
            mujoco.mj_geomDistance(
                model, data, model.geom(tip_geom(hand)).id, model.geom(hand.geom).id, 1.0, None
            )
            for hand in scene.hands
        ]
    )


@each_scenario
def test_hands_start_their_standoff_away_and_are_clear_until_they_touch(name):
    scene, path = scenario(name), planned(name)
    np.testing.assert_array_equal(path.start, path.q[0][0])
    np.testing.assert_array_equal(path.start, path.at(0, 0.0)[0])
    # Faces and round tips: distance along the normal is that of the geoms. MuJoCo's is iterative.
    assert distances(name, 0, 0.0) == pytest.approx(scene.standoff, abs=1e-6)
    assert scene.standoff > 0.01
    for index, phase in enumerate(scene.phases):
        for progress in (0.25, 0.5, 0.75, 1.0):
            _, gap = asked(path.schedule, index, progress)
            assert distances(name, index, progress) == pytest.approx(gap, abs=1e-6)
            assert gap == 0.0 or path.schedule.free[index], phase.name


@each_scenario
def test_hands_approach_and_leave_along_the_normals(name):
    scene, path, model = scenario(name), planned(name), posed_model(name)
    moving = 0
    for index in np.flatnonzero(path.schedule.free):
        tilt = asked(path.schedule, index, 0.0)[0]
        R_WO, _ = ScrewPath(scene.path).pose(tilt)
        for hand in scene.hands:
            tips = []
            for progress in np.linspace(0.0, 1.0, 7):
                data = posed(scene, model, path.at(index, progress)[0], tilt)
                tips.append(data.site(tip_site(hand)).xpos.copy())
            way = np.array(tips) - tips[0]
            along = way @ (R_WO @ hand.normal_O)
            across = way - np.outer(along, R_WO @ hand.normal_O)
            assert np.abs(across).max() < BETWEEN
            moving += np.abs(along).max() > 0.004
    assert moving >= 2 * len(scene.hands)


@each_scenario
def test_holding_a_tilt_is_the_posture_in_which_the_path_comes_through_it(name):
    path = planned(name)
    schedule = path.schedule
    for index, phase in enumerate(schedule.phases):
        before = schedule.before(index)
        if phase.grip > 0.0 and phase.tilt > before.tilt:
            for progress in np.linspace(0.0, 1.0, 11):
                tilt, _ = asked(schedule, index, progress)
                # A tilt and its share of the path: a rounding or two of 1 rad.
                np.testing.assert_allclose(
                    path.holding(tilt), path.at(index, progress)[0], rtol=0, atol=1e-13
                )
            assert np.abs(path.holding(schedule.end / 2) - path.holding(schedule.end)).max() > 0.01


@each_scenario
@pytest.mark.parametrize("share", [-0.01, 1.01, np.nan])
def test_a_tilt_that_the_path_does_not_come_through_is_refused(name, share):
    path = planned(name)
    with pytest.raises(InvalidInputError, match=r"^tilt: got .* deg; valid is between 0 and"):
        path.holding(share * path.schedule.end)
