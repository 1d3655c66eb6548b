"""The plant's forces obey Newton, its readings are copies, and it fails loudly, not with NaN."""

import itertools
from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from dm_control.rl.control import PhysicsError
from scipy.spatial.transform import Rotation

from scenarios import scenario
from sim.contacts import ContactFrames
from sim.ik import plan_joints
from sim.path import Schedule, ScrewPath
from sim.plant import Plant
from sim.robot import RobotModel
from sim.scenario import GRAVITY, Geom, Pose
from sim.scene import compose
from sim.settings import Physics

BOX = scenario("box-tilt")
WEIGHT = BOX.object.mass * GRAVITY
ROBOT = RobotModel(BOX)
FRAMES = ContactFrames(BOX)
HANDS = len(BOX.hands)
# Joint impedance that keeps the arms where they are while they push [rad/s].
BANDWIDTH = 30.0


@cache
def planned():
    path = ScrewPath(BOX.path)
    return plan_joints(BOX, path, Schedule(BOX.timing, path.end))


def plant_at(tilt_deg):
    """A plant that starts at rest at a tilt, and the arms' angles there."""
    R_WO, p_WO = ScrewPath(BOX.path).pose(np.radians(tilt_deg))
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    start = Pose(tuple(p_WO.tolist()), tuple(quaternion.tolist()))
    plant = Plant(replace(BOX, path=replace(BOX.path, start=start)))
    q = planned()(np.radians(tilt_deg))[0]
    plant.reset(q)
    return plant, q


def rotation_of(measurement):
    return Rotation.from_quat(measurement.quat_WO, scalar_first=True).as_matrix()


def push(plant, q_d, f_n, steps):
    """Steps with a feed-forward for normal forces f_n [N], (2,), around angles q_d."""
    for _ in range(steps):
        m = plant.measure()
        R_WO = rotation_of(m)
        ROBOT.update(m.q)
        p_WC, R_WC = FRAMES.points(R_WO, m.p_WO)[:HANDS], FRAMES.in_world(R_WO)[:HANDS]
        forces = np.einsum("nl,n->l", ROBOT.contact_jacobians(p_WC, R_WC)[:, 2], f_n)
        impedance = BANDWIDTH**2 * (q_d - m.q) - 2.0 * BANDWIDTH * m.qd
        plant.apply(ROBOT.gravity() + forces + ROBOT.mass_matrix() @ impedance)
        plant.step()


def named_contacts(plant):
    """Points and wrenches of the named contacts, (m, 3 | 4); NaN points where there are none."""
    points, wrenches = np.full((4, 3), np.nan), np.full((4, 4), np.nan)
    plant.contacts(points, wrenches)
    return points, wrenches


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


def test_box_at_rest_on_the_table_is_carried_by_its_four_corners():
    plant, q = plant_at(0.0)
    push(plant, q, (0.0, 0.0), 500)
    force, moment = every_contact(plant)
    # The solver's tolerance of 1e-10 on 20 N; measured 2e-14.
    np.testing.assert_allclose(force, [0.0, 0.0, WEIGHT], rtol=0, atol=1e-8)
    np.testing.assert_allclose(moment, 0.0, rtol=0, atol=1e-8)
    _, wrenches = named_contacts(plant)
    # Only the two corners of the edge have names; the other half of the weight is on the others.
    expected = np.zeros((4, 4))
    expected[HANDS:, 2] = WEIGHT / 4.0
    np.testing.assert_allclose(wrenches, expected, rtol=0, atol=1e-8)


def test_a_box_that_is_pulled_up_is_carried_by_less_than_its_weight():
    plant, q = plant_at(0.0)
    plant.physics.data.xfrc_applied[plant.physics.model.body("box").id, 2] = 1.0
    push(plant, q, (0.0, 0.0), 500)
    assert every_contact(plant)[0][2] == pytest.approx(WEIGHT - 1.0, abs=1e-8)


def test_squeezing_hands_push_equally_and_oppositely_with_the_force_fed_forward():
    plant, q = plant_at(0.0)
    push(plant, q, (20.0, 20.0), 600)
    points, wrenches = named_contacts(plant)
    left, right = wrenches[:HANDS, 1]
    # The impedance takes its share of the 15 µm by which the contacts give: 0.5 %.
    assert -left == pytest.approx(20.0, rel=0.01)
    assert right == pytest.approx(-left, rel=1e-4)
    # Force on the object: from each side into the box.
    assert left < 0.0 < right
    expected = FRAMES.points(np.eye(3), np.array(BOX.path.start.position))
    # Contact points lie half-way into the overlap of 15 µm; the arms give a few µm sideways.
    np.testing.assert_allclose(points, expected, rtol=0, atol=2e-5)


def test_an_uneven_squeeze_is_caught_in_the_hand_forces():
    plant, q = plant_at(0.0)
    push(plant, q, (21.0, 20.0), 600)
    left, right = named_contacts(plant)[1][:HANDS, 1]
    assert abs(left + right) > 1e-2


def rows_of(plant, q, steps):
    """Measurement before, and twist, points and wrenches during each of some steps."""
    rows = []
    for _ in range(steps):
        measurement, twist = plant.measure(), np.zeros(6)
        push(plant, q, (40.0, 40.0), 1)
        plant.object_twist(twist)
        rows.append((measurement, twist, *named_contacts(plant)))
    return rows


def balance_errors(plant, q, steps=30):
    """Largest errors of Newton's and Euler's laws over steps of a falling, squeezed box.

    Returns:
        Errors in force [N] and in moment about the centre of mass [N·m] with the torsional moments
        as read, the latter with their sign reversed, and the largest force on the box [N].
    """
    mass, inertia = BOX.object.mass, np.diag(BOX.object.inertia)
    dt = BOX.physics.timestep
    rows, errors = rows_of(plant, q, steps + 1), []
    for (m, twist, points, wrenches), (m_next, twist_next, _, _) in itertools.pairwise(rows):
        R, R_next = rotation_of(m), rotation_of(m_next)
        change = mass * (twist_next[:3] - twist[:3]) / dt
        force = wrenches[:, :3].sum(axis=0) - [0.0, 0.0, WEIGHT]
        # Euler's equation in the box's own axes, in which its inertia stays.
        omega, omega_next = R.T @ twist[3:], R_next.T @ twist_next[3:]
        spin_up = inertia @ (omega_next - omega) / dt + np.cross(omega, inertia @ omega)
        live = ~np.isnan(points[:, 0])
        arm = np.cross(points[live] - m.p_WO, wrenches[live, :3]).sum(axis=0)
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
    p_WE, quat_WE, twist_WE = np.zeros((2, 2, 3)), np.zeros((2, 2, 4)), np.zeros((2, 2, 6))
    p_WO, R_WO, twist_WO = np.zeros((2, 3)), np.zeros((2, 3, 3)), np.zeros((2, 6))
    for k in range(2):
        m = plant.measure()
        p_WO[k], R_WO[k] = m.p_WO, rotation_of(m)
        push(plant, q, (40.0, 40.0), 1)
        plant.tips(p_WE[k], quat_WE[k], twist_WE[k])
        plant.object_twist(twist_WO[k])
    dt = BOX.physics.timestep
    turn_O = Rotation.from_matrix(R_WO[1] @ R_WO[0].T).as_rotvec()
    R_WE = Rotation.from_quat(quat_WE.reshape(4, 4), scalar_first=True)
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
    plant.physics.forward()
    points, wrenches = named_contacts(plant)
    np.testing.assert_array_equal(wrenches[HANDS:], 0.0)
    assert np.isnan(points[HANDS:]).all()


def standing(geom, support):
    """Wrench [N, N·m] at one named support of another object that rests on the table alone."""
    scene = replace(
        BOX,
        object=replace(BOX.object, geoms=(geom,)),
        supports=(replace(BOX.supports[0], p_OP_O=support),),
        robot=replace(BOX.robot, posture={}),
    )
    plant = Plant(scene)
    plant.reset(np.zeros(0))
    for _ in range(300):
        plant.step()
    points, wrenches = np.zeros((HANDS + 1, 3)), np.zeros((HANDS + 1, 4))
    plant.contacts(points, wrenches)
    return wrenches[HANDS]


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


# --- state ---


def test_measurements_are_copies():
    plant, q = plant_at(30.0)
    push(plant, q, (40.0, 40.0), 3)
    before, again = plant.measure(), plant.measure()
    for field in ("q", "qd", "p_WO", "quat_WO"):
        array = getattr(before, field)
        array += 1.0
        np.testing.assert_array_equal(getattr(plant.measure(), field), getattr(again, field))
        np.testing.assert_array_equal(array, getattr(again, field) + 1.0)


def test_measurement_is_the_state_after_the_step_by_the_names_of_the_joints():
    plant, q = plant_at(30.0)
    push(plant, q, (40.0, 40.0), 3)
    data, measurement = plant.physics.data, plant.measure()
    assert measurement.t == pytest.approx(3 * BOX.physics.timestep, abs=1e-15)
    assert plant.joints == ROBOT.joints
    for i, joint in enumerate(plant.joints):
        assert measurement.q[i] == data.joint(joint).qpos[0]
        assert measurement.qd[i] == data.joint(joint).qvel[0]
    np.testing.assert_array_equal(measurement.p_WO, data.joint("box").qpos[:3])
    np.testing.assert_array_equal(measurement.quat_WO, data.joint("box").qpos[3:])
    assert np.abs(measurement.qd).min() > 0.0


def test_motors_cut_torques_at_their_limits():
    states, forces = [], []
    for scale in (1.0, 1e3, 0.99):
        plant, _ = plant_at(30.0)
        plant.apply(scale * ROBOT.tau_max)
        plant.step()
        states.append(plant.measure().qd)
        forces.append(plant.physics.data.actuator_force.copy())
    np.testing.assert_array_equal(forces[0], ROBOT.tau_max)
    np.testing.assert_array_equal(forces[1], ROBOT.tau_max)
    np.testing.assert_array_equal(states[1], states[0])
    # A torque below the limits is not.
    assert (forces[2] != forces[0]).all()
    assert (states[2] != states[0]).all()


def states_of(plant, q, steps):
    plant.reset(q)
    rows = []
    for _ in range(steps):
        push(plant, q, (40.0, 40.0), 1)
        m = plant.measure()
        rows.append(np.concatenate([[m.t], m.q, m.qd, m.p_WO, m.quat_WO]))
    return np.array(rows)


def test_reset_repeats_the_run_bit_for_bit():
    plant, q = plant_at(30.0)
    first = states_of(plant, q, 50)
    np.testing.assert_array_equal(states_of(plant, q, 50), first)
    np.testing.assert_array_equal(states_of(plant_at(30.0)[0], q, 50), first)
    # The last bit of a start angle is caught.
    assert not np.array_equal(states_of(plant, np.nextafter(q, 2.0), 50), first)


def test_reset_puts_everything_at_rest_at_the_start():
    plant, q = plant_at(30.0)
    push(plant, q, (40.0, 40.0), 20)
    plant.reset(q)
    m = plant.measure()
    assert m.t == 0.0
    np.testing.assert_array_equal(m.q, q)
    np.testing.assert_array_equal(m.qd, 0.0)
    np.testing.assert_array_equal(plant.physics.data.ctrl, 0.0)
    np.testing.assert_array_equal(plant.physics.velocity(), 0.0)


# --- divergence ---


def fast_box(plant):
    plant.physics.data.joint("box").qvel[:] = 1e12


def nan_angle(plant):
    plant.physics.data.joint("left_e1").qpos[0] = np.nan


def infinite_speed(plant):
    plant.physics.data.joint("left_e1").qvel[0] = np.inf


def nan_torque(plant):
    plant.apply(np.full(len(plant.joints), np.nan))


def huge_force(plant):
    plant.physics.data.xfrc_applied[:] = 1e20


@pytest.mark.parametrize("blow", [fast_box, nan_angle, infinite_speed, nan_torque, huge_force])
def test_a_diverging_state_is_an_error(blow):
    plant, q = plant_at(30.0)
    push(plant, q, (40.0, 40.0), 5)
    blow(plant)
    with pytest.raises(PhysicsError, match="mjWARN_BAD"):
        for _ in range(5):
            plant.step()


def test_a_fast_but_finite_state_is_none():
    plant, q = plant_at(30.0)
    plant.physics.data.joint("box").qvel[:] = 1.0
    push(plant, q, (40.0, 40.0), 20)
    assert np.isfinite(plant.measure().q).all()


# --- the contact settings ---


def creep(physics, share):
    """Speed of a resting box on the table under a sideways push, a share of its friction [µm/s]."""
    nobody = replace(BOX.robot, posture={})
    model = compose(replace(BOX, robot=nobody, physics=physics)).compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body("box").id, 0] = share * BOX.supports[0].friction.mu * WEIGHT
    settling = round(0.5 / physics.timestep)
    mujoco.mj_step(model, data, settling)
    start = data.qpos[0]
    mujoco.mj_step(model, data, 2 * settling)
    assert data.ncon == 4 or share > 1.0
    return abs(data.qpos[0] - start) * 1e6


def test_resting_contact_under_load_does_not_creep():
    # Measured: 4e-7 µm/s. A run of ten seconds would add 0.1 µm at this bound, of 100 allowed.
    assert creep(BOX.physics, 0.6) < 0.01


@pytest.mark.parametrize(
    ("loose", "at_least"),
    [
        (Physics(noslip_iterations=0), 0.02),
        (Physics(noslip_iterations=0, impratio=10.0), 0.2),
        (Physics(noslip_iterations=0, impratio=10.0, solref_friction=(0.01, 1.0)), 1.0),
    ],
)
def test_looser_contact_settings_creep_visibly(loose, at_least):
    assert creep(loose, 0.6) > at_least


def test_box_holds_up_to_its_friction_and_slides_beyond_it():
    # 5 % either side of the cone; MuJoCo's cone is exact, the corners' loads differ by the push.
    assert creep(BOX.physics, 0.95) < 0.01
    assert creep(BOX.physics, 1.05) > 1e4
