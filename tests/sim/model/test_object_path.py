"""The object's path is a screw motion, its tilt is read back, and its timing starts and stops."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.object_path import ScrewPath, minimum_jerk
from fulcrum.sim.scenario.path import Pivot
from fulcrum.synthesis import InvalidInputError

# Positions are of the order of 1 m and angles of 1 rad: a few roundings of 2e-16 each.
ROUNDING = 1e-13

unit_floats = st.floats(-1.0, 1.0)
vectors = st.tuples(unit_floats, unit_floats, unit_floats)
# Short vectors have no well-defined direction.
directions = vectors.filter(lambda v: np.linalg.norm(v) > 0.1)
rotation_vectors = vectors.map(Rotation.from_rotvec)
poses = st.builds(
    lambda p, turn: Pose(p, tuple(turn.as_quat(scalar_first=True).tolist())),
    vectors,
    rotation_vectors,
)
pivots = st.builds(Pivot, start=poses, point_W=vectors, axis_W=directions, pitch=unit_floats)
tilts = st.floats(np.radians(-170.0), np.radians(170.0))
exhaustive = settings(derandomize=True, deadline=None, max_examples=100)


def homogeneous(R, p):
    return np.block([[R, p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def exponential(pivot, tilt):
    """The pose by the matrix exponential of the screw, independent of rotation vectors."""
    axis = np.array(pivot.axis_W) / np.linalg.norm(pivot.axis_W)
    screw = np.zeros((4, 4))
    screw[:3, :3] = np.cross(np.eye(3), axis)
    screw[:3, 3] = -np.cross(axis, pivot.point_W) + pivot.pitch * axis
    start = homogeneous(pivot.start.rotation.as_matrix(), np.array(pivot.start.position))
    return expm(screw * tilt) @ start


def quaternion(R):
    return Rotation.from_matrix(R).as_quat(scalar_first=True)


# --- the screw motion ---


@exhaustive
@given(pivots)
def test_pose_at_zero_tilt_is_the_start(pivot):
    R, p = ScrewPath(pivot).pose(0.0)
    np.testing.assert_allclose(R, pivot.start.rotation.as_matrix(), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(p, pivot.start.position, rtol=0, atol=ROUNDING)


@exhaustive
@given(pivots, tilts)
def test_pose_is_the_exponential_of_the_screw(pivot, tilt):
    pose = homogeneous(*ScrewPath(pivot).pose(tilt))
    np.testing.assert_allclose(pose, exponential(pivot, tilt), rtol=0, atol=ROUNDING)


def test_a_point_or_pitch_off_by_a_millimetre_is_caught_by_the_exponential():
    pivot = scenario("box-tilt").path
    shifted = replace(pivot, point_W=(pivot.point_W[0] + 1e-3, *pivot.point_W[1:]))
    for tampered in (shifted, replace(pivot, pitch=1e-3)):
        pose = homogeneous(*ScrewPath(tampered).pose(1.0))
        # The point moves by 2 sin(1/2) times its error, the pitch by its error.
        assert np.abs(pose - exponential(pivot, 1.0)).max() > 5e-4


@exhaustive
@given(pivots, tilts)
def test_motion_is_rigid(pivot, tilt):
    R, _ = ScrewPath(pivot).pose(tilt)
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=ROUNDING)
    assert np.linalg.det(R) > 0.0


@exhaustive
@given(pivots, tilts, unit_floats)
def test_axis_points_only_advance_by_the_pitch(pivot, tilt, along):
    path = ScrewPath(pivot)
    on_axis = np.array(pivot.point_W) + along * path.direction
    R_0, p_0 = path.pose(0.0)
    R, p = path.pose(tilt)
    moved = R @ R_0.T @ (on_axis - p_0) + p
    np.testing.assert_allclose(
        moved, on_axis + pivot.pitch * tilt * path.direction, rtol=0, atol=ROUNDING
    )


@exhaustive
@given(pivots, vectors, tilts)
def test_axis_points_move_by_the_advance_per_radian(pivot, travel, tilt):
    path = ScrewPath(replace(pivot, travel=travel))
    R_0, p_0 = path.pose(0.0)
    R, p = path.pose(tilt)
    moved = R @ R_0.T @ (path.point - p_0) + p
    # Travels of 1 m in 90 deg are advances of less than 2 m/rad: twice the rounding.
    np.testing.assert_allclose(moved - path.point, tilt * path.advance, rtol=0, atol=2.0 * ROUNDING)
    # At the end the whole travel has been added to the pitch.
    whole = pivot.pitch * path.end * path.direction + np.array(travel)
    np.testing.assert_allclose(path.end * path.advance, whole, rtol=0, atol=ROUNDING)


def test_an_advance_without_the_travel_is_caught():
    lifted = ScrewPath(replace(scenario("box-tilt").path, pitch=0.1, travel=(0.0, 0.0, 0.001)))
    R_0, p_0 = lifted.pose(0.0)
    R, p = lifted.pose(lifted.end)
    moved = R @ R_0.T @ (lifted.point - p_0) + p
    assert np.abs(moved - lifted.point - lifted.end * 0.1 * lifted.direction).max() > 9e-4


@exhaustive
@given(pivots, tilts)
def test_a_point_off_the_axis_moves_by_the_chord(pivot, tilt):
    path = ScrewPath(replace(pivot, pitch=0.0))
    radius = np.cross(path.direction, [0.6, -0.8, 0.3])
    off_axis = np.array(pivot.point_W) + radius
    R_0, p_0 = path.pose(0.0)
    R, p = path.pose(tilt)
    moved = R @ R_0.T @ (off_axis - p_0) + p
    chord = 2.0 * abs(np.sin(tilt / 2.0)) * np.linalg.norm(radius)
    assert np.linalg.norm(moved - off_axis) == pytest.approx(chord, abs=ROUNDING)


def test_box_stands_on_its_near_face_after_a_quarter_turn():
    R, p = ScrewPath(scenario("box-tilt").path).pose(np.pi / 2.0)
    np.testing.assert_allclose(p, [0.45, 0.0, 0.15], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(R @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], rtol=0, atol=ROUNDING)


def test_turning_about_the_opposite_axis_is_caught_below_the_table():
    pivot = scenario("box-tilt").path
    opposite = tuple(-x for x in pivot.axis_W)
    assert ScrewPath(replace(pivot, axis_W=opposite)).pose(np.pi / 2.0)[1][2] < -0.1


@pytest.mark.parametrize(
    "axis", [(0.0, 0.0, 0.0), (np.nan, 0.0, 1.0), (np.inf, 0.0, 1.0), (0.0, -np.inf, 0.0)]
)
def test_an_axis_that_is_no_direction_is_refused(axis):
    with pytest.raises(InvalidInputError, match=r"path\.axis_W: got .*; valid is a finite vector"):
        ScrewPath(replace(scenario("box-tilt").path, axis_W=axis))


@pytest.mark.parametrize("angle_deg", [0.0, -30.0, 180.0, np.nan, np.inf])
def test_an_angle_that_cannot_be_followed_is_refused(angle_deg):
    with pytest.raises(InvalidInputError, match=r"path\.angle_deg: got .*; valid is"):
        ScrewPath(replace(scenario("box-tilt").path, angle_deg=angle_deg))


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("point_W", {"point_W": (np.nan, 0.0, 0.0)}),
        ("pitch", {"pitch": np.inf}),
    ],
)
def test_a_path_that_is_no_number_is_refused_by_name(field, change):
    with pytest.raises(
        InvalidInputError, match=rf"path\.{field}: got .*; valid is (a )?finite number"
    ):
        ScrewPath(replace(scenario("box-tilt").path, **change))


def test_a_pose_that_is_no_number_is_refused_by_name():
    for name, numbers in (
        ("position", (0.0, -np.inf, 0.0)),
        ("quaternion", (np.nan, 0.0, 0.0, 0.0)),
    ):
        with pytest.raises(InvalidInputError, match=rf"pose\.{name}: got .*; valid is"):
            Pose(**{name: numbers})


# --- the tilt that is read back ---


@exhaustive
@given(pivots, tilts)
def test_tilt_inverts_pose(pivot, tilt):
    path = ScrewPath(pivot)
    q = quaternion(path.pose(tilt)[0])
    # Ten times the rounding: the matrix's largest quaternion component is divided by.
    assert path.tilt(q) == pytest.approx(tilt, abs=10.0 * ROUNDING)
    assert path.tilt(-q) == pytest.approx(tilt, abs=10.0 * ROUNDING)


@exhaustive
@given(pivots, tilts, directions, st.floats(-1.0, 1.0), st.booleans())
def test_swing_about_an_axis_across_does_not_count_as_tilt(pivot, tilt, direction, angle, before):
    path = ScrewPath(pivot)
    across = np.cross(path.direction, direction)
    swing = Rotation.from_rotvec(angle * across)
    turn = Rotation.from_rotvec(tilt * path.direction)
    # The swing may come before or after the tilt.
    moved = (turn * swing if before else swing * turn) * pivot.start.rotation
    # Near a half turn with much swing the twist is the angle of a short vector (cos 85 deg).
    found = path.tilt(moved.as_quat(scalar_first=True))
    assert found == pytest.approx(tilt, abs=100.0 * ROUNDING)


@exhaustive
@given(pivots, tilts, directions, st.floats(-0.01, 0.01))
def test_a_small_oblique_turn_counts_by_its_share_about_the_axis(pivot, tilt, direction, angle):
    path = ScrewPath(pivot)
    disturbance = angle * np.array(direction)
    turn = Rotation.from_rotvec(disturbance) * Rotation.from_rotvec(tilt * path.direction)
    found = path.tilt((turn * pivot.start.rotation).as_quat(scalar_first=True))
    # What is left is of second order in the disturbance, of length sqrt(3) * angle at most.
    expected = tilt + disturbance @ path.direction
    assert found == pytest.approx(expected, abs=3.0 * angle**2 + 10.0 * ROUNDING)


def test_tilt_of_an_array_is_the_tilt_of_each():
    path = ScrewPath(scenario("box-tilt").path)
    angles = np.random.default_rng(0).uniform(-2.9, 2.9, (3, 5))
    q = np.array([[quaternion(path.pose(a)[0]) for a in row] for row in angles])
    np.testing.assert_array_equal(path.tilt(q), [[path.tilt(one) for one in row] for row in q])
    np.testing.assert_allclose(path.tilt(q), angles, rtol=0, atol=10.0 * ROUNDING)


# --- the profile in time ---


def derivatives_at_ends(profile, h=1e-4):
    """Position, speed and acceleration by one-sided differences at both ends, (2, 3)."""
    rows = []
    for end, step in ((0.0, h), (1.0, -h)):
        x = profile(end + step * np.arange(3))
        rows.append([x[0], (x[1] - x[0]) / step, (x[2] - 2.0 * x[1] + x[0]) / h**2])
    return np.array(rows)


def test_minimum_jerk_starts_and_ends_at_rest_without_acceleration():
    position, speed, acceleration = derivatives_at_ends(lambda x: minimum_jerk(x)[0]).T
    np.testing.assert_array_equal(position, [0.0, 1.0])
    # Near the ends the profile is 10 x^3: differences over h = 1e-4 leave 10 h^2 and 60 h, and
    # rounding of 1 over h^2 another 1e-7.
    np.testing.assert_allclose(speed, 0.0, rtol=0, atol=1.1 * 10.0 * 1e-8)
    np.testing.assert_allclose(acceleration, 0.0, rtol=0, atol=1.1 * 60.0 * 1e-4)


def test_a_cubic_profile_is_caught_by_its_acceleration():
    acceleration = derivatives_at_ends(lambda x: x**2 * (3.0 - 2.0 * x))[:, 2]
    np.testing.assert_allclose(np.abs(acceleration), 6.0, rtol=1e-2)


def test_minimum_jerk_velocity_is_the_derivative_and_never_negative():
    x, h = np.linspace(0.001, 0.999, 1000), 1e-5
    slope = (minimum_jerk(x + h)[0] - minimum_jerk(x - h)[0]) / (2.0 * h)
    # Third derivative 60 times h^2 / 6 = 1e-9; rounding of 1 over 2 h = 1e-11.
    np.testing.assert_allclose(minimum_jerk(x)[1], slope, rtol=0, atol=2e-9)
    assert (minimum_jerk(x)[1] > 0.0).all()


def test_minimum_jerk_stays_at_its_ends_outside_the_interval():
    np.testing.assert_array_equal(minimum_jerk(np.array([-2.0, 0.0, 1.0, 5.0]))[0], [0, 0, 1, 1])
    np.testing.assert_array_equal(minimum_jerk(np.array([-2.0, 0.0, 1.0, 5.0]))[1], 0.0)
