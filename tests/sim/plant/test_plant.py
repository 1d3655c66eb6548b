"""The plant's forces obey Newton, and what touches against the scenario's will is named."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.plant.mujoco import MujocoPlant
from tests.helpers.plants import (
    BOX,
    FRAMES,
    HANDS,
    WEIGHT,
    planned,
    plant_at,
    push,
    start_at,
    stepped,
)


def every_contact(plant):
    """Force [N] and moment about the object's origin [N·m] of all of MuJoCo's contacts."""
    model, data = plant.physics.model.ptr, plant.physics.data.ptr
    thing = model.body("box").id
    force, moment, buffer = np.zeros(3), np.zeros(3), np.zeros(6)
    for i in range(data.ncon):
        first, second = model.geom_bodyid[data.contact.geom[i]]
        assert thing in (first, second)
        mujoco.mj_contactForce(model, data, i, buffer)
        axes = data.contact.frame[i].reshape(3, 3) * (1.0 if second == thing else -1.0)
        f, m = axes.T @ buffer[:3], axes.T @ buffer[3:]
        force += f
        moment += np.cross(data.contact.pos[i] - data.xpos[thing], f) + m
    return force, moment


# --- forces ---


def alone():
    """The box flat on the table and the hands where they come from, and the arms' angles there.

    Hands at their contacts without a force would graze the box as the arms settle, by 1e-4 N.
    """
    plant, _ = plant_at(0.0)
    q = planned().start
    plant.reset(q)
    return plant, q


def test_box_at_rest_on_the_table_is_carried_by_its_four_corners():
    plant, q = alone()
    block = push(plant, q, (0.0, 0.0), 500)
    force, moment = every_contact(plant)
    # The solver's tolerance of 1e-10 on 20 N; measured 2e-14.
    np.testing.assert_allclose(force, [0.0, 0.0, WEIGHT], rtol=0, atol=1e-8)
    np.testing.assert_allclose(moment, 0.0, rtol=0, atol=1e-8)
    # Only the two corners of the edge have names; the other half of the weight is on the others.
    expected = np.zeros((4, 4))
    expected[HANDS:, 2] = WEIGHT / 4.0
    np.testing.assert_allclose(block.f_W[-1], expected, rtol=0, atol=1e-8)


def test_a_box_that_is_pulled_up_is_carried_by_less_than_its_weight():
    plant, q = alone()
    plant.physics.data.xfrc_applied[plant.physics.model.body("box").id, 2] = 1.0
    push(plant, q, (0.0, 0.0), 500)
    assert every_contact(plant)[0][2] == pytest.approx(WEIGHT - 1.0, abs=1e-8)


def test_squeezing_hands_push_equally_and_oppositely_with_the_force_fed_forward():
    plant, q = plant_at(0.0)
    block = push(plant, q, (20.0, 20.0), 600)
    left, right = block.f_W[-1, :HANDS, 1]
    # The impedance takes its share of the 15 µm by which the contacts give: 0.5 %.
    assert -left == pytest.approx(20.0, rel=0.01)
    assert right == pytest.approx(-left, rel=1e-4)
    # Force on the object: from each side into the box.
    assert left < 0.0 < right
    expected = FRAMES.points(np.eye(3), np.array(BOX.path.start.position))
    # Contact points lie half-way into the overlap of 15 µm; the arms give a few µm sideways.
    np.testing.assert_allclose(block.p_WC[-1], expected, rtol=0, atol=2e-5)


def test_an_uneven_squeeze_is_caught_in_the_hand_forces():
    plant, q = plant_at(0.0)
    left, right = push(plant, q, (21.0, 20.0), 600).f_W[-1, :HANDS, 1]
    assert abs(left + right) > 1e-2


def balance_errors(plant, q, steps=30):
    """Largest errors of Newton's and Euler's laws over steps of a falling, squeezed box.

    Returns:
        Errors in force [N] and in moment about the centre of mass [N·m] with the torsional moments
        as read, the latter with their sign reversed, and the largest force on the box [N].
    """
    mass, inertia = BOX.object.mass, np.diag(BOX.object.inertia)
    dt = BOX.physics.timestep
    block, errors = push(plant, q, (40.0, 40.0), steps + 1), []
    rotations = Rotation.from_quat(block.quat_WO, scalar_first=True).as_matrix()
    for k in range(steps):
        (R, R_next), (twist, twist_next) = rotations[k : k + 2], block.twist_WO[k : k + 2]
        points, wrenches = block.p_WC[k], block.f_W[k]
        change = mass * (twist_next[:3] - twist[:3]) / dt
        force = wrenches[:, :3].sum(axis=0) - [0.0, 0.0, WEIGHT]
        # Euler's equation in the box's own axes, in which its inertia stays.
        omega, omega_next = R.T @ twist[3:], R_next.T @ twist_next[3:]
        spin_up = inertia @ (omega_next - omega) / dt + np.cross(omega, inertia @ omega)
        live = ~np.isnan(points[:, 0])
        arm = np.cross(points[live] - block.p_WO[k], wrenches[live, :3]).sum(axis=0)
        torsion = (FRAMES.in_world(R)[..., 2] * wrenches[:, 3:]).sum(axis=0)
        errors.append(
            [
                np.abs(force - change).max(),
                np.abs(R.T @ (arm + torsion) - spin_up).max(),
                np.abs(R.T @ (arm - torsion) - spin_up).max(),
                np.abs(change).max(),
            ]
        )
    return np.max(errors, axis=0)


@pytest.mark.parametrize("tilt_deg", [10.0, 30.0, 60.0])
def test_named_contacts_of_a_moving_box_obey_newton_and_euler(tilt_deg):
    plant, q = plant_at(tilt_deg)
    push(plant, q, (40.0, 40.0), 10)
    force, moment, reversed_moment, change = balance_errors(plant, q)
    # Rounding of speeds of 0.1 m/s over dt = 1 ms; measured 2e-14.
    assert force < 1e-12
    # MuJoCo takes the gyroscopic moment implicitly: dt I |omega| |d omega / dt| is
    # 1e-3 * 0.02 * 1 * 50. With slower speeds it is 1e-6.
    assert moment < 1e-3
    # What is tested does move, and torsion of the wrong sign is caught.
    assert change > 1.0
    assert reversed_moment > 100.0 * moment


def test_twists_are_the_derivatives_of_their_poses():
    plant, q = plant_at(30.0)
    push(plant, q, (40.0, 40.0), 10)
    block = push(plant, q, (40.0, 40.0), 2)
    p_WE, twist_WE = block.p_WE, block.twist_WE
    p_WO, twist_WO = block.p_WO, block.twist_WO
    dt = BOX.physics.timestep
    R_WO = Rotation.from_quat(block.quat_WO, scalar_first=True)
    turn_O = (R_WO[1] * R_WO[0].inv()).as_rotvec()
    R_WE = Rotation.from_quat(block.quat_WE.reshape(4, 4), scalar_first=True)
    turn_E = (R_WE[2:] * R_WE[:2].inv()).as_rotvec()
    # A step is made with the speed after it: for the free box exactly, up to rounding over dt.
    np.testing.assert_allclose((p_WO[1] - p_WO[0]) / dt, twist_WO[1, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(turn_O / dt, twist_WO[1, 3:], rtol=0, atol=1e-12)
    # Turning joints bend the tips' path: (0.3 rad/s)^2 at levers of 1 m, times dt / 2, is 5e-5.
    np.testing.assert_allclose((p_WE[1] - p_WE[0]) / dt, twist_WE[1, :, :3], rtol=0, atol=5e-5)
    np.testing.assert_allclose(turn_E / dt, twist_WE[1, :, 3:], rtol=0, atol=5e-5)
    # The twists of the step before are caught.
    assert np.abs((p_WO[1] - p_WO[0]) / dt - twist_WO[0, :3]).max() > 1e-4
    assert np.abs((p_WE[1] - p_WE[0]) / dt - twist_WE[0, :, :3]).max() > 1e-4


def test_lost_contacts_have_no_force_and_leave_their_last_point():
    plant, _ = plant_at(0.0)
    plant.physics.data.joint("box").qpos[2] += 0.05
    block = stepped(plant, 1)
    np.testing.assert_array_equal(block.f_W[0, HANDS:], 0.0)
    assert np.isnan(block.p_WC[0, HANDS:]).all()


def standing(geom, support):
    """Wrench [N, N·m] at one named support of another object that rests on the table alone."""
    scene = replace(
        BOX,
        object=replace(BOX.object, geoms=(geom,)),
        supports=(replace(BOX.supports[0], p_OP_O=support),),
        robots=(replace(BOX.robots[0], posture={}),),
    )
    plant = MujocoPlant(scene)
    plant.reset(np.zeros(0))
    return stepped(plant, 300, contacts=HANDS + 1).f_W[-1, HANDS]


@pytest.mark.parametrize("kind", ["sphere", "box"])
def test_force_is_on_the_object_in_whichever_order_mujoco_has_the_geoms(kind):
    # MuJoCo orders a pair by the geoms' types: a ball comes before the table, a box after it.
    geom = Geom("box", kind, (0.05, 0.05, 0.05))
    support = (0.05, 0.05, -0.05) if kind == "box" else (0.0, 0.0, -0.05)
    share = WEIGHT / 4.0 if kind == "box" else WEIGHT
    # The solver's tolerance of 1e-10 on 20 N, and what is left of settling by 1 µm.
    np.testing.assert_allclose(standing(geom, support), [0, 0, share, 0], rtol=0, atol=1e-6)


def test_contacts_near_a_named_point_add_up_there():
    # Two corners, 3 mm beside the point, of the four that carry the weight.
    blade = Geom("box", "box", (0.15, 0.003, 0.05))
    np.testing.assert_allclose(
        standing(blade, (-0.15, 0.0, -0.05)), [0, 0, WEIGHT / 2.0, 0], rtol=0, atol=1e-6
    )
    # At 10 mm a corner is another point's.
    board = Geom("box", "box", (0.15, 0.011, 0.05))
    np.testing.assert_array_equal(standing(board, (-0.15, 0.0, -0.05)), 0.0)


# --- what must not touch ---

POST = Geom("post", "sphere", (0.05,))


def with_post(at):
    """The plant at a tilt of 30 deg with a post somewhere [m], in the present contacts."""
    path = replace(BOX.path, start=start_at(30.0))
    post = replace(POST, pose=Pose(tuple(at)))
    plant = MujocoPlant(replace(BOX, path=path, environment=(*BOX.environment, post)))
    plant.reset(planned().holding(np.radians(30.0)))
    return plant


def wrist_at(dx=0.0, dy=0.0, dz=0.0):
    """Where the left wrist is, and a place beside it [m]."""
    plant, _ = plant_at(30.0)
    return plant.physics.named.data.geom_xpos["left_wrist"] + np.array([dx, dy, dz])


def test_a_link_that_touches_what_stands_around_is_counted_and_named_with_the_time():
    # On the wrist's inner side, where it pushes the hand off the box instead of into it.
    plant = with_post(wrist_at(0.0, -0.03, 0.0))
    assert plant.collisions == {}
    block = stepped(plant, 1)
    assert block.collisions[0] > 0
    (names,) = [pair for pair in plant.collisions if "left_wrist" in pair]
    assert set(names) == {"left_wrist", "post"}
    assert plant.collisions[names] == 0.0
    # It is no contact of the scenario: its force counts nowhere.
    without_post = stepped(plant_at(30.0)[0], 1)
    np.testing.assert_array_equal(block.f_W[0, :HANDS], without_post.f_W[0, :HANDS])
    # The first time stays, and a reset forgets it.
    stepped(plant, 3)
    assert plant.collisions[names] == 0.0
    plant.reset(planned().holding(np.radians(30.0)))
    assert plant.collisions == {}


def test_a_link_pushes_back_at_what_it_touches():
    blocked, free = with_post(wrist_at(0.03, 0.0, 0.03)), plant_at(30.0)[0]
    for plant in (blocked, free):
        plant.step()
    assert np.abs(blocked.measure().qd - free.measure().qd).max() > 1e-2


def test_a_post_beside_the_arm_is_touched_by_nothing():
    plant = with_post(wrist_at(0.0, 0.4, 0.0))
    assert not stepped(plant, 1).collisions.any()
    assert plant.collisions == {}


def test_the_box_on_the_table_and_the_hands_on_the_box_are_no_collisions():
    plant, q = plant_at(0.0)
    block = push(plant, q, (20.0, 20.0), 50)
    assert not block.collisions.any()
    assert plant.collisions == {}
    assert np.abs(block.f_W[-1, :HANDS, 1]).min() > 1.0
