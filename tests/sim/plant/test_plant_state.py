"""The plant's readings are copies, it fails loudly, not with NaN, and its contacts do not creep."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.sim.model.scene import compose
from fulcrum.sim.plant import DivergedError
from fulcrum.sim.scenario.physics import Physics
from tests.helpers.plants import BOX, ROBOT, WEIGHT, plant_at, push

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
    with pytest.raises(DivergedError, match=r"diverged at 0\.00[5-9] s"):
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
    nobody = (replace(BOX.robots[0], posture={}),)
    model = compose(replace(BOX, robots=nobody, physics=physics)).compile()
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
        (Physics(noslip_iterations=0), 0.015),
        (Physics(noslip_iterations=0, impratio=100.0), 1.5),
        (Physics(noslip_iterations=0, impratio=10.0), 15.0),
    ],
)
def test_looser_contact_settings_creep_visibly(loose, at_least):
    assert creep(loose, 0.6) > at_least


def test_box_holds_up_to_its_friction_and_slides_beyond_it():
    # 5 % either side of the cone; MuJoCo's cone is exact, the corners' loads differ by the push.
    assert creep(BOX.physics, 0.95) < 0.01
    assert creep(BOX.physics, 1.05) > 1e4
