"""Worlds deviate in what they say and in nothing else; truth goes to the plant alone."""

import math
from dataclasses import fields, replace

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.model.scene import compose, hand_body, tip_site
from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.plant.truth import make_true
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.world.motors import Motors
from fulcrum.sim.world.presets import FIELD, HARSH, LAB, NOMINAL, PRESETS, Uncertainty, draw, preset
from fulcrum.sim.world.pushes import Pushes
from fulcrum.sim.world.sensors import Sensors
from fulcrum.sim.world.world import NO_DEVIATION, Push, World
from fulcrum.synthesis import InvalidInputError

BOX, CYLINDER = scenario("box-tilt"), scenario("cylinder-tilt")
JOINTS = 14
# Of draws from uniform ranges: the share that is nearly at the end of its range.
DRAWS = 200


def test_a_world_without_deviation_is_the_scenario_itself():
    for scene in (BOX, CYLINDER):
        assert NO_DEVIATION.truth(scene) == scene


def test_each_part_of_the_truth_is_what_the_world_says():
    world = World(
        mass=1.2, center_of_mass=(0.01, -0.02, 0.03), friction=(0.5, 0.6, 0.7, 0.7), size=1.1
    )
    truth = world.truth(BOX)
    assert truth.object.mass == pytest.approx(1.2 * BOX.object.mass)
    assert truth.object.center_of_mass == pytest.approx((0.01, -0.02, 0.03))
    np.testing.assert_allclose(truth.object.inertia, 1.2 * 1.1**2 * np.array(BOX.object.inertia))
    np.testing.assert_allclose(truth.object.geoms[0].size, 1.1 * np.array(BOX.object.geoms[0].size))
    contacts = (*truth.hands, *truth.supports)
    believed = (*BOX.hands, *BOX.supports)
    factors = [c.friction.mu / b.friction.mu for c, b in zip(contacts, believed, strict=True)]
    assert factors == pytest.approx([0.5, 0.6, 0.7, 0.7])


def test_an_object_of_another_size_still_lies_on_its_pivot():
    for scene in (BOX, CYLINDER):
        plant = MujocoPlant(World(size=0.9).truth(scene))
        point = np.array(scene.path.point_W)
        for support in World(size=0.9).truth(scene).supports:
            p_WC = plant.measure().p_WO + support.p_OP_O
            # Along the axis the edge is shorter; across it, it is where it was.
            across = (p_WC - point) - np.dot(p_WC - point, scene.path.axis_W) * np.array(
                scene.path.axis_W
            )
            np.testing.assert_allclose(across, 0.0, rtol=0, atol=1e-12)


def test_a_displaced_hand_touches_as_far_from_its_place_as_the_world_says():
    world = World(hand_place=((0.005, -0.003), (0.0, 0.0)))
    truth = world.truth(BOX)
    moved = np.array(truth.hands[0].p_OC_O) - BOX.hands[0].p_OC_O
    normal, tangent = np.array(BOX.hands[0].normal_O), np.array(BOX.hands[0].tangent_O)
    expected = 0.005 * tangent - 0.003 * np.cross(normal, tangent)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-15)
    nominal, model = compose(BOX).compile(), compose(BOX).compile()
    make_true(model, BOX, world)
    tips = []
    for scene in (nominal, model):
        data = mujoco.MjData(scene)
        mujoco.mj_kinematics(scene, data)
        site = scene.site(tip_site(BOX.hands[0])).id
        tips.append((data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()))
    (p, R), (q, _) = tips
    # Tip axes are the contact's (t, o, n).
    np.testing.assert_allclose(R.T @ (q - p), [0.005, -0.003, 0.0], rtol=0, atol=1e-12)
    other = hand_body(BOX.hands[1])
    np.testing.assert_array_equal(model.body(other).pos, nominal.body(other).pos)


def test_links_and_joint_friction_are_changed_where_the_world_says():
    model, nominal = compose(BOX).compile(), compose(BOX).compile()
    factors = tuple(1.0 + 0.01 * i for i in range(JOINTS))
    make_true(model, BOX, World(link_mass=factors, joint_friction=(0.3,) * JOINTS))
    for i, factor in enumerate(factors):
        joint = int(model.actuator(i).trnid[0])
        body = model.jnt_bodyid[joint]
        assert model.body_mass[body] == pytest.approx(factor * nominal.body_mass[body])
        assert model.dof_frictionloss[model.jnt_dofadr[joint]] == 0.3
    assert model.body_subtreemass[0] > nominal.body_subtreemass[0]


def test_motors_make_gain_times_torque_plus_offset_and_noise_of_the_given_size():
    limits, tau = np.full(2, 10.0), np.array([1.0, -2.0])
    names = ("first", "second")
    world = World(torque_gain=(0.9, 1.1), torque_offset=(0.5, 0.0))
    made = Motors(world, limits, names).torques(0.0, tau)
    np.testing.assert_allclose(made, [1.4, -2.2])
    noisy = Motors(World(torque_noise=0.01), limits, names)
    samples = np.array([noisy.torques(0.0, tau) for _ in range(2000)])
    # Standard deviations of 2000 samples are off by 1.6 %; four times that.
    np.testing.assert_allclose(samples.std(axis=0), 0.1, rtol=0.065)


def test_noise_of_the_sensors_has_the_given_size_and_leaves_the_plant_alone():
    world = World(seed=3, position_noise=0.001, orientation_noise=0.01, encoder_noise=1e-4)
    plant = MujocoPlant(BOX, world)
    sensors, truth = Sensors(world, plant.joints), plant.measure()
    seen = [sensors.see(plant.measure()) for _ in range(2000)]
    p = np.array([m.p_WO for m in seen])
    np.testing.assert_allclose(p.std(axis=0), 0.001, rtol=0.065)
    np.testing.assert_allclose(np.std([m.q - truth.q for m in seen], axis=0), 1e-4, rtol=0.065)
    turn = np.array([m.quat_WO for m in seen])
    np.testing.assert_allclose(np.linalg.norm(turn, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(2.0 * turn[:, 1:].std(axis=0), 0.01, rtol=0.065)
    np.testing.assert_array_equal(plant.measure().q, truth.q)
    np.testing.assert_array_equal(plant.measure().p_WO, truth.p_WO)


def test_sensors_of_a_world_without_noise_hand_on_what_they_get():
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    given = Measurement(0.0, np.ones(2), np.ones(2), np.ones(3), turn, np.ones(2))
    seen = Sensors(NO_DEVIATION, ("first", "second")).see(given)
    assert seen is given


def pushed(pushes, steps):
    """A plant after steps in which nothing but pushes acts on arms and object."""
    plant, forces = MujocoPlant(BOX), Pushes(World(pushes=pushes))
    plant.reset(np.zeros(JOINTS))
    for _ in range(steps):
        plant.apply(np.zeros(JOINTS), forces.at(plant.measure().t))
        plant.step()
    return plant


def test_a_push_moves_the_object_for_as_long_as_it_lasts():
    push = Push(t=0.0, duration_s=0.05, force_W=(0.0, 0.0, 30.0), p_OA_O=(0.0, 0.0, 0.0))
    heights = {}
    for name, pushes in (("pushed", (push,)), ("alone", ())):
        plant = pushed(pushes, 50)
        heights[name] = plant.measure().p_WO[2]
    # (30 - 20) N on 20 N lift it by half of 0.5 g t^2.
    rise = 0.5 * 0.5 * 9.81 * 0.05**2
    assert heights["pushed"] - heights["alone"] == pytest.approx(rise, rel=0.1)


def test_a_push_beside_the_centre_turns_the_object():
    push = Push(t=0.0, duration_s=0.05, force_W=(0.0, 0.0, 30.0), p_OA_O=(0.15, 0.0, 0.0))
    plant = pushed((push,), 20)
    assert plant.measure().quat_WO[2] < -1e-4  # up at +x is about -y


# --- drawing ---


def test_the_same_seed_draws_the_same_world_and_another_another():
    for uncertainty in PRESETS.values():
        assert draw(uncertainty, BOX, 7) == draw(uncertainty, BOX, 7)
    assert draw(FIELD, BOX, 7) != draw(FIELD, BOX, 8)


def test_the_nominal_preset_draws_worlds_that_deviate_in_nothing():
    world = draw(NOMINAL, BOX, 5)
    assert world.truth(BOX) == BOX
    assert set(world.torque_gain) == set(world.link_mass) == {1.0}
    assert not world.pushes


@pytest.mark.parametrize("uncertainty", [LAB, HARSH])  # field is harsh with other numbers
def test_draws_fill_their_ranges_and_stay_within(uncertainty):
    u, worlds = uncertainty, [draw(uncertainty, BOX, seed) for seed in range(DRAWS)]

    def fills(values, low, high):
        values, width = np.array(values), high - low
        assert values.min() >= low
        assert values.max() <= high
        assert np.ptp(values) > 0.95 * width

    fills([w.mass for w in worlds], 1.0 - u.mass, 1.0 + u.mass)
    for axis in range(3):
        fills([w.center_of_mass[axis] for w in worlds], -u.center_of_mass, u.center_of_mass)
    for contact in range(3):
        low, high = 1.0 - u.friction_down, 1.0 + u.friction_up
        fills([w.friction[contact] for w in worlds], low, high)
    fills([gain for w in worlds for gain in w.torque_gain], 1 - u.torque_gain, 1 + u.torque_gain)
    if u.hand_place:
        fills([x for w in worlds for xy in w.hand_place for x in xy], -u.hand_place, u.hand_place)
    forces = np.array([push.force_W for w in worlds for push in w.pushes]).reshape(-1, 3)
    assert len(forces) == u.pushes * DRAWS
    if u.pushes:
        assert 0.9 * u.push < np.linalg.norm(forces, axis=1).max() <= u.push
        # Directions have no bias: the mean of n unit vectors is about 1 / sqrt(n) long.
        mean = np.mean(forces / np.linalg.norm(forces, axis=1, keepdims=True), axis=0)
        assert np.linalg.norm(mean) < 4.0 / math.sqrt(len(forces))


def test_pushes_come_while_the_object_is_held_and_act_within_its_bounds():
    half = np.array(BOX.object.geoms[0].size)
    for seed in range(50):
        for push in draw(HARSH, BOX, seed).pushes:
            assert 3.3 <= push.t <= 11.8  # from the end of grip to the end of set down
            assert (np.abs(push.p_OA_O) <= half).all()


def test_contacts_of_the_same_two_surfaces_have_the_same_friction():
    world = draw(HARSH, BOX, 1)
    assert world.friction[2] == world.friction[3]
    assert len(set(world.friction)) == 3
    MujocoPlant(world.truth(BOX), world)  # which refuses anything else


# --- refusals ---


@pytest.mark.parametrize(
    "change",
    [
        {"mass": 0.0},
        {"mass": math.nan},
        {"size": -1.0},
        {"center_of_mass": (0.0, math.inf, 0.0)},
        {"friction": (0.0,)},
        {"joint_friction": (-1.0,)},
        {"torque_noise": -1.0},
        {"latency": math.nan},
        {"dropped": 1.0},
        {"seed": -1},
    ],
)
def test_senseless_worlds_are_refused_with_the_name_of_the_field(change):
    with pytest.raises(InvalidInputError, match=f"world.{next(iter(change))}"):
        replace(NO_DEVIATION, **change)


def test_a_world_of_another_scenario_is_refused():
    with pytest.raises(InvalidInputError, match=r"world\.friction: got 2 values; valid is none or"):
        World(friction=(1.0, 1.0)).truth(BOX)
    with pytest.raises(InvalidInputError, match=r"world\.torque_gain"):
        make_true(compose(BOX).compile(), BOX, World(torque_gain=(1.0,)))


def test_senseless_ranges_and_unknown_presets_are_refused():
    for field in fields(Uncertainty):
        with pytest.raises(InvalidInputError, match=field.name):
            Uncertainty(**{field.name: -1})
    with pytest.raises(InvalidInputError, match="in \\[0, 1\\)"):
        Uncertainty(mass=1.0)
    with pytest.raises(InvalidInputError, match="one of nominal, lab, field, harsh"):
        preset("calm")
    with pytest.raises(InvalidInputError, match="seed"):
        draw(LAB, BOX, -1)
