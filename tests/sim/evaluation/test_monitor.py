"""The monitor against motions made by hand, whose slip, slide, spin and wrenches are known."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.sim.evaluation.monitor import ContactHistory, Monitor
from fulcrum.sim.model.object_path import ScrewPath
from tests.helpers.motions import (
    ACROSS,
    BOX,
    DT,
    EDGE_LEFT,
    EDGE_RIGHT,
    FIELDS,
    GRIP_S,
    LEFT,
    MOVE_S,
    PHASES,
    RIGHT,
    ROUNDING,
    SETTLED,
    STEPS,
    TANGENT,
    from_settling,
    resting,
    tilting,
    translate,
    watched,
)

# --- relative motion ---


@pytest.mark.parametrize("make", [resting, tilting])
def test_no_relative_motion_is_no_slip_no_slide_and_no_spin_of_the_hands(make):
    history = watched(make())
    for quantity in (history.slip, history.slide, history.spin):
        np.testing.assert_allclose(quantity[:, :2], 0.0, rtol=0, atol=ROUNDING)
    assert history.kept.all()


def test_edge_contacts_of_a_tilting_box_stay_where_they_are():
    history = watched(tilting())
    np.testing.assert_allclose(history.slip[:, 2:], 0.0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.slide[:, 2:], 0.0, rtol=0, atol=ROUNDING)
    # The box turns about the edge, which lies across the table's normal.
    np.testing.assert_allclose(history.spin[:, 2:], 0.0, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("make", [resting, tilting])
@pytest.mark.parametrize("direction", [TANGENT, ACROSS, (TANGENT - ACROSS) / np.sqrt(2.0)])
def test_a_hand_that_moves_along_the_face_slips_and_slides_by_its_way(make, direction):
    trace, speed = make(), 0.02
    translate(trace, LEFT, from_settling(speed * direction))
    history = watched(trace)
    way = speed * DT * np.maximum(np.arange(STEPS) - SETTLED, 0)
    np.testing.assert_allclose(history.slip[:, LEFT], way, rtol=0, atol=ROUNDING)
    # The integral counts the step that begins at a row, too.
    ahead = speed * DT * np.maximum(np.arange(STEPS) - SETTLED + 1, 0)
    np.testing.assert_allclose(history.slide[:, LEFT], ahead, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.spin[:, LEFT], 0.0, rtol=0, atol=ROUNDING)
    # The other contacts are not blamed.
    others = [RIGHT, EDGE_LEFT, EDGE_RIGHT]
    np.testing.assert_allclose(history.slip[:, others], 0.0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.slide[:, others], 0.0, rtol=0, atol=ROUNDING)


def test_moving_there_and_back_leaves_no_slip_but_twice_the_slide():
    trace = resting()
    moving = 2 * ((STEPS - SETTLED) // 2)
    velocity = np.zeros((STEPS, 3))
    velocity[SETTLED : SETTLED + moving // 2] = 0.02 * TANGENT
    velocity[SETTLED + moving // 2 : SETTLED + moving] = -0.02 * TANGENT
    translate(trace, RIGHT, velocity)
    history = watched(trace)
    way = 0.02 * DT * moving / 2
    # The last row is before the last step.
    assert history.slip[-1, RIGHT] == pytest.approx(0.02 * DT, abs=ROUNDING)
    assert history.slip[:, RIGHT].max() == pytest.approx(way, abs=ROUNDING)
    assert history.slide[-1, RIGHT] == pytest.approx(2.0 * way, abs=ROUNDING)


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_a_hand_that_turns_about_the_normal_spins_in_place(hand):
    trace, speed = tilting(), 0.5
    normal = np.array(BOX.hands[hand].normal_O)  # the box turns about it
    angle = speed * DT * np.maximum(np.arange(STEPS) - SETTLED, 0)
    turn = Rotation.from_rotvec(angle[:, None] * normal)
    R_WE = Rotation.from_quat(trace.quat_WE[:, hand], scalar_first=True)
    trace.quat_WE[:, hand] = (turn * R_WE).as_quat(scalar_first=True)
    trace.twist_WE[:, hand, 3:] += from_settling(speed * normal)
    history = watched(trace)
    # Of the object against the hand; the integral counts the step that begins at a row, too.
    ahead = speed * DT * np.maximum(np.arange(STEPS) - SETTLED + 1, 0)
    np.testing.assert_allclose(history.spin[:, hand], -ahead, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.slip[:, hand], 0.0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.slide[:, hand], 0.0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.spin[:, 1 - hand], 0.0, rtol=0, atol=ROUNDING)


def test_an_object_that_turns_on_the_table_spins_and_slides_at_its_edge():
    trace, speed = resting(), 0.5
    trace.twist_WO[SETTLED:, 5] = speed
    history = watched(trace)
    turned = speed * DT * (STEPS - SETTLED)
    np.testing.assert_allclose(history.spin[-1, 2:], turned, rtol=0, atol=ROUNDING)
    # The edge's ends are 0.15 m behind and 0.1 m beside the box's centre.
    expected = turned * np.hypot(0.15, 0.1)
    np.testing.assert_allclose(history.slide[-1, 2:], expected, rtol=0, atol=ROUNDING)
    # At the hands it is a tangential speed of 0.075 m times omega along x, and no spin.
    np.testing.assert_allclose(history.spin[-1, :2], 0.0, rtol=0, atol=ROUNDING)


def test_an_object_that_moves_over_the_table_slips_there_by_its_way():
    trace, way = resting(), np.zeros((STEPS, 3))
    way[SETTLED:, 0] = 1e-3 * np.linspace(0.0, 1.0, STEPS - SETTLED)
    trace.p_WO[:] += way
    trace.p_WE[:] += way[:, None]
    history = watched(trace)
    expected = np.repeat(way[:, :1], 2, axis=1)
    np.testing.assert_allclose(history.slip[:, 2:], expected, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.slip[:, :2], 0.0, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("make", [resting, tilting])
def test_moving_along_the_normal_is_no_slip(make):
    trace = make()
    translate(trace, LEFT, from_settling(0.02 * np.array(BOX.hands[LEFT].normal_O)))
    history = watched(trace)
    np.testing.assert_allclose(history.slip[:, LEFT], 0.0, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(history.slide[:, LEFT], 0.0, rtol=0, atol=ROUNDING)


def test_motion_before_the_grip_is_settled_does_not_count():
    trace = resting()
    velocity = np.zeros((STEPS, 3))
    velocity[:SETTLED] = 0.02 * TANGENT
    translate(trace, LEFT, velocity)
    trace.twist_WE[:SETTLED, LEFT, 3:] = BOX.hands[LEFT].normal_O
    history = watched(trace)
    for quantity in (history.slip, history.slide, history.spin):
        np.testing.assert_allclose(quantity[:, LEFT], 0.0, rtol=0, atol=ROUNDING)
    # A single step after that is counted.
    velocity[SETTLED] = 0.02 * TANGENT
    trace = resting()
    translate(trace, LEFT, velocity)
    assert watched(trace).slip[-1, LEFT] == pytest.approx(0.02 * DT, abs=ROUNDING)
    assert watched(trace).slide[-1, LEFT] == pytest.approx(0.02 * DT, abs=ROUNDING)


def test_rolling_without_sliding_moves_material_points_apart_but_does_not_slide():
    # The tip, a ball of 30 mm, turns about the box's long axis; its contact moves along the face.
    trace, speed = resting(), 0.1
    axis, normal = ACROSS, np.array(BOX.hands[LEFT].normal_O)
    angle = speed * DT * np.maximum(np.arange(STEPS) - SETTLED, 0)
    center_velocity = np.cross(speed * axis, 0.03 * -normal)
    trace.twist_WE[SETTLED:, LEFT, 3:] += speed * axis
    translate(trace, LEFT, from_settling(center_velocity))
    way = np.linalg.norm(center_velocity) * angle / speed
    trace.p_WC[:, LEFT] += way[:, None] * center_velocity / np.linalg.norm(center_velocity)
    turn = Rotation.from_rotvec(angle[:, None] * axis)
    R_WE = Rotation.from_quat(trace.quat_WE[:, LEFT], scalar_first=True)
    trace.quat_WE[:, LEFT] = (turn * R_WE).as_quat(scalar_first=True)
    history = watched(trace)
    np.testing.assert_allclose(history.slide[:, LEFT], 0.0, rtol=0, atol=ROUNDING)
    # The ball's old contact point lags by r (angle - sin angle), of third order in 0.025 rad.
    assert 0.0 < history.slip[-1, LEFT] < 0.03 * angle[-1] ** 3 / 6.0 * 1.01


# --- wrenches ---


def test_forces_in_the_world_become_wrenches_in_contact_axes():
    trace = tilting()
    force = np.array([3.0, -4.0, 5.0])
    trace.f_W[..., :3], trace.f_W[..., 3] = force, [0.1, 0.2, 0.0, 0.0]
    history = watched(trace)
    path = ScrewPath(BOX.path)
    angles = path.tilt(trace.quat_WO)
    c, s = np.cos(angles), np.sin(angles)
    # The box's up axis, the hands' first tangent, at a tilt about -y.
    up = np.stack([-s, 0.0 * s, c], axis=1)
    f_t = up @ force
    np.testing.assert_allclose(history.w_measured_C[:, LEFT, 0], f_t, rtol=0, atol=10 * ROUNDING)
    np.testing.assert_allclose(history.w_measured_C[:, RIGHT, 0], f_t, rtol=0, atol=10 * ROUNDING)
    # The left hand presses along -y, the right one along +y.
    np.testing.assert_allclose(history.w_measured_C[:, LEFT, 2], 4.0, rtol=0, atol=10 * ROUNDING)
    np.testing.assert_allclose(history.w_measured_C[:, RIGHT, 2], -4.0, rtol=0, atol=10 * ROUNDING)
    # o = n x t: for the left hand -y x up, which is the box's short way towards -x.
    along = np.stack([c, 0.0 * s, s], axis=1) @ force
    np.testing.assert_allclose(history.w_measured_C[:, LEFT, 1], -along, rtol=0, atol=10 * ROUNDING)
    np.testing.assert_allclose(history.w_measured_C[:, RIGHT, 1], along, rtol=0, atol=10 * ROUNDING)
    # At the edge the axes stay: t = x, o = z x x = y, n = z.
    expected = np.broadcast_to(force, (STEPS, 2, 3))
    np.testing.assert_allclose(
        history.w_measured_C[:, 2:, :3], expected, rtol=0, atol=10 * ROUNDING
    )
    moments = np.broadcast_to([0.1, 0.2, 0.0, 0.0], (STEPS, 4))
    np.testing.assert_array_equal(history.w_measured_C[..., 5], moments)
    np.testing.assert_array_equal(history.w_measured_C[..., 3:5], 0.0)


def test_utilisation_is_of_the_true_friction():
    trace = resting()
    # Left: half of mu = 0.1 along o; right: all of it by torsion, mu e_n = 0.05 m.
    trace.f_W[:, LEFT] = [0.5, -10.0, 0.0, 0.0]
    trace.f_W[:, RIGHT] = [0.0, 10.0, 0.0, -0.5]
    # The edge: 3-4-5 of mu = 0.25, and half as much again.
    trace.f_W[:, EDGE_LEFT] = [1.5, 2.0, 10.0, 0.0]
    trace.f_W[:, EDGE_RIGHT] = [0.0, 3.75, 10.0, 0.0]
    expected = np.broadcast_to([0.5, 1.0, 1.0, 1.5], (STEPS, 4))
    np.testing.assert_allclose(watched(trace).utilisation, expected, rtol=0, atol=ROUNDING)


def test_a_lost_contact_is_not_kept():
    trace = resting()
    trace.f_W[100:110, RIGHT] = 0.0
    history = watched(trace)
    expected = np.ones((STEPS, 4), bool)
    expected[100:110, RIGHT] = False
    np.testing.assert_array_equal(history.kept, expected)
    np.testing.assert_array_equal(history.utilisation[100:110, RIGHT], 0.0)


def test_drift_counts_only_while_the_object_is_held_with_full_grip():
    # The last phase lets go instead of holding: from there on nothing counts any more.
    leaving = replace(BOX, phases=(*PHASES[:2], replace(PHASES[2], name="let go", grip=0.0)))
    trace = resting()
    translate(trace, LEFT, np.tile(0.02 * TANGENT, (STEPS, 1)))
    trace.twist_WE[:, LEFT, 3:] += BOX.hands[LEFT].normal_O
    let_go = round((GRIP_S + MOVE_S) / DT)
    there, held = Monitor(leaving).update(trace), watched(trace)
    for rows in (slice(0, SETTLED), slice(let_go, None)):
        np.testing.assert_array_equal(there.slip[rows], 0.0)
        assert np.ptp(there.slide[rows], axis=0).max() == 0.0
        assert np.ptp(there.spin[rows], axis=0).max() == 0.0
    np.testing.assert_array_equal(there.slip[:let_go], held.slip[:let_go])
    np.testing.assert_array_equal(there.slide[:let_go], held.slide[:let_go])
    # With a phase that holds, it does count.
    assert held.slip[-1, LEFT] > there.slip[let_go - 1, LEFT] + 5e-4
    assert held.slide[-1, LEFT] > there.slide[-1, LEFT] + 5e-4
    assert there.slip[let_go - 1, LEFT] > 1e-3


# --- blocks ---


def busy_trace():
    """Everything moves and pushes, smoothly but oddly."""
    rng = np.random.default_rng(0)
    trace = tilting()
    for hand in (LEFT, RIGHT):
        translate(trace, hand, rng.normal(size=(STEPS, 3)))
        trace.twist_WE[:, hand, 3:] += rng.normal(size=(STEPS, 3))
    trace.p_WO[:] += 1e-3 * np.cumsum(rng.normal(size=(STEPS, 3)), axis=0)
    trace.twist_WO[:] += rng.normal(size=(STEPS, 6))
    trace.f_W[:] += rng.normal(size=trace.f_W.shape)
    return trace


@pytest.mark.parametrize(
    "cuts",
    [
        [SETTLED],
        [SETTLED - 1, SETTLED + 1],
        [1, 2, 3, STEPS - 1],
        list(range(10, STEPS, 10)),
        list(range(1, STEPS)),
    ],
)
def test_block_by_block_is_the_same_as_at_once(cuts):
    trace, monitor = busy_trace(), Monitor(BOX)
    edges = [0, *cuts, STEPS]
    parts = [monitor.update(trace.rows(a, b)) for a, b in itertools.pairwise(edges)]
    blockwise, at_once = ContactHistory.concatenate(parts), watched(trace)
    for field in FIELDS:
        # Sums may be associated otherwise: some 250 roundings of 1.
        np.testing.assert_allclose(
            getattr(blockwise, field), getattr(at_once, field), rtol=0, atol=1e-13, err_msg=field
        )
    for quantity in (at_once.slip, at_once.slide, np.abs(at_once.spin)):
        assert quantity[-1].min() > 1e-4


def test_a_monitor_that_starts_anew_half_way_is_caught():
    trace = busy_trace()
    anew, at_once = watched(trace.rows(STEPS // 2, STEPS)), watched(trace)
    for field in ("slip", "slide", "spin"):
        assert np.abs(getattr(anew, field)[-1] - getattr(at_once, field)[-1]).max() > 1e-4, field
