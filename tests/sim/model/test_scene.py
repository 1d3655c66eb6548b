"""The composed scene is what the scenario says, and the committed files are what it composes."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.assets import asset_path
from fulcrum.assets.models import robot_spec
from fulcrum.scenarios import scenario, scenarios
from fulcrum.scenarios.scene_files import scene_xml
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.links import link_pairs
from fulcrum.sim.model.scene import (
    ObjectMotion,
    compose,
    hand_body,
    object_pairs,
    tip_geom,
    tip_site,
)
from fulcrum.sim.scenario.contacts import Friction

BOX = scenario("box-tilt")
# MJCF is printed with six digits, so that joint angles above 1 rad are off by up to 5e-6 rad and
# those below by 5e-7 rad, at levers of up to 1.2 m and over seven joints. Measured: 4e-7 m.
PRINTED = 1e-5

each_scenario = pytest.mark.parametrize("scene", scenarios().values(), ids=scenarios())


@cache
def composed(name):
    return compose(scenario(name)).compile()


def names(model, kind, count):
    return [getattr(model, kind)(i).name for i in range(count)]


def tip_distances(scene, model, data):
    """Distances of the hands' tips from the geoms that they touch [m]."""
    return [
        mujoco.mj_geomDistance(
            model, data, model.geom(tip_geom(hand)).id, model.geom(hand.geom).id, 1.0, None
        )
        for hand in scene.hands
    ]


# --- the committed files ---


@each_scenario
def test_committed_scene_is_what_the_scenario_makes(scene):
    assert asset_path(f"{scene.name}.xml").read_text() == scene_xml(scene)


def test_a_heavier_object_is_caught_in_the_committed_scene():
    heavier = replace(BOX, object=replace(BOX.object, mass=BOX.object.mass * 1.001))
    assert asset_path("box-tilt.xml").read_text() != scene_xml(heavier)


@each_scenario
def test_committed_scene_opens_as_a_file_with_the_tips_their_standoff_away_at_its_start(scene):
    model = mujoco.MjModel.from_xml_path(str(asset_path(f"{scene.name}.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)
    off = np.array(tip_distances(scene, model, data)) - scene.standoff
    assert np.abs(off).max() < PRINTED
    # A milliradian in every joint is caught.
    data.qpos[model.jnt_qposadr[model.actuator_trnid[:, 0]]] += 1e-3
    mujoco.mj_forward(model, data)
    off = np.array(tip_distances(scene, model, data)) - scene.standoff
    assert np.abs(off).max() > 10.0 * PRINTED


@each_scenario
def test_committed_scene_is_the_composed_one_to_its_printed_digits(scene):
    model = mujoco.MjModel.from_xml_path(str(asset_path(f"{scene.name}.xml")))
    expected = composed(scene.name)
    for field in (
        "body_mass",
        "body_pos",
        "geom_size",
        "pair_friction",
        "pair_solref",
        "dof_damping",
    ):
        # Six digits are printed.
        np.testing.assert_allclose(
            getattr(model, field), getattr(expected, field), rtol=5e-6, atol=1e-12, err_msg=field
        )
    for field in ("timestep", "impratio", "noslip_iterations", "cone", "integrator", "tolerance"):
        assert getattr(model.opt, field) == getattr(expected.opt, field), field


# --- object, contacts, environment ---


@each_scenario
def test_object_has_the_scenario_s_mass_inertia_and_start(scene):
    model = composed(scene.name)
    body, thing = model.body(scene.object.name), scene.object
    assert body.mass[0] == thing.mass
    np.testing.assert_array_equal(body.ipos, thing.center_of_mass)
    # The full inertia about the body's axes, however MuJoCo orders its principal axes.
    axes = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
    inertia = axes @ np.diag(body.inertia) @ axes.T
    largest = max(thing.inertia)
    # Rounding.
    np.testing.assert_allclose(inertia, np.diag(thing.inertia), rtol=0, atol=1e-14 * largest)
    np.testing.assert_array_equal(body.pos, scene.path.start.position)
    # MuJoCo normalises quaternions.
    np.testing.assert_allclose(body.quat, scene.path.start.quaternion, rtol=0, atol=1e-15)
    assert [g for g in names(model, "geom", model.ngeom) if model.geom(g).bodyid == body.id] == [
        geom.name for geom in thing.geoms
    ]


def is_wanted(pair):
    """Pairs of the scenario's contacts have names; those that must not touch have none."""
    return bool(pair.name)


def pair_frictions(model):
    """condim and friction of each pair that may touch, by the names of its two geoms."""
    return {
        frozenset(model.geom(int(g)).name for g in (pair.geom1[0], pair.geom2[0])): (
            int(pair.dim[0]),
            pair.friction[:3].tolist(),
        )
        for pair in filter(is_wanted, map(model.pair, range(model.npair)))
    }


def expected_frictions(scene):
    """Soft fingers carry torsion up to mu e_n f_n; points with friction carry none."""
    touching = [(tip_geom(hand), hand.geom, hand.friction) for hand in scene.hands]
    touching += [(s.surface, s.geom, s.friction) for s in (*scene.supports, *scene.rests)]
    return {
        frozenset((first, second)): (
            (3, [f.mu, f.mu, 0.0]) if f.e_n is None else (4, [f.mu, f.mu, f.mu * f.e_n])
        )
        for first, second, f in touching
    }


@each_scenario
def test_contact_pairs_have_the_scenario_s_friction_and_nothing_else_collides(scene):
    model = composed(scene.name)
    assert pair_frictions(model) == expected_frictions(scene)
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()


def unwanted(model):
    """Names of the geoms of each pair that must not touch."""
    pairs = [p for p in map(model.pair, range(model.npair)) if not is_wanted(p)]
    return [frozenset(model.geom(int(g[0])).name for g in (p.geom1, p.geom2)) for p in pairs]


def expected_unwanted(scene, model):
    """Every geom on a body that joints of the robot carry, with object and environment."""
    surroundings = {g.name for g in (*scene.object.geoms, *scene.environment) if g.solid}
    carried = set()
    for body in range(model.nbody):
        parent = int(model.body_parentid[body])
        own = {model.joint(j).name for j in range(model.njnt) if model.jnt_bodyid[j] == body}
        if own & set(scene.posture) or parent in carried:
            carried.add(body)
    links = [model.geom(g).name for g in range(model.ngeom) if model.geom_bodyid[g] in carried]
    touching = {frozenset((tip_geom(hand), hand.geom)) for hand in scene.hands}
    own = {frozenset((a, b)) for a in links for b in surroundings} - touching
    data = mujoco.MjData(model)
    for joint, angle in scene.posture.items():
        data.joint(joint).qpos[:] = angle
    mujoco.mj_kinematics(model, data)
    apart = {frozenset(pair) for pair in link_pairs(scene, model, data)}
    return own | apart | {frozenset(pair) for pair in object_pairs(scene)}


@each_scenario
def test_robot_links_touch_object_and_environment_through_pairs_of_their_own(scene):
    model = composed(scene.name)
    found = unwanted(model)
    assert len(found) == len(set(found)) > 10
    assert set(found) == expected_unwanted(scene, model)
    # The tips, too, may touch nothing but the geom that they hold.
    for hand in scene.hands:
        solid = {g.name for g in (*scene.object.geoms, *scene.environment) if g.solid}
        others = solid - {hand.geom}
        assert {frozenset((tip_geom(hand), other)) for other in others} <= set(found)


def test_what_stands_in_the_scene_is_among_what_must_not_be_touched():
    post = Geom("post", "sphere", (0.05,))
    model = compose(replace(BOX, environment=(*BOX.environment, post))).compile()
    added = set(unwanted(model)) - set(unwanted(composed("box-tilt")))
    assert added
    assert all("post" in pair for pair in added)
    assert frozenset(("left_wrist", "post")) in added


@pytest.mark.parametrize("friction", [Friction(0.1, 0.4), Friction(0.11, 0.5), Friction(0.1)])
def test_another_friction_is_caught_in_the_contact_pairs(friction):
    left, right = BOX.hands
    other = replace(BOX, hands=(replace(left, friction=friction), right))
    assert pair_frictions(compose(other).compile()) != expected_frictions(BOX)
    assert pair_frictions(compose(other).compile()) == expected_frictions(other)


@each_scenario
def test_physics_settings_reach_the_model(scene):
    physics = replace(scene.physics, timestep=0.0007, impratio=33.0, noslip_iterations=3)
    for settings in (scene.physics, physics):
        model = compose(replace(scene, physics=settings)).compile()
        option = model.opt
        assert (option.timestep, option.impratio) == (settings.timestep, settings.impratio)
        assert option.noslip_iterations == settings.noslip_iterations
        assert option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
        assert option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        np.testing.assert_array_equal(option.gravity, [0.0, 0.0, -9.81])


def test_environment_stands_where_the_scenario_puts_it():
    pose = Pose((0.1, 0.2, 0.3), (0.8, 0.6, 0.0, 0.0))
    peg = Geom("peg", "capsule", (0.02, 0.1), pose)
    model = compose(replace(BOX, environment=(*BOX.environment, peg))).compile()
    geom = model.geom("peg")
    assert geom.bodyid == 0
    assert geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE
    np.testing.assert_array_equal(geom.size, [0.02, 0.1, 0.0])
    np.testing.assert_array_equal(geom.pos, pose.position)
    # MuJoCo normalises quaternions.
    np.testing.assert_allclose(geom.quat, pose.quaternion, rtol=0, atol=1e-15)


# --- robot and hands ---


@each_scenario
def test_only_driven_joints_move_and_each_has_its_motor(scene):
    model = composed(scene.name)
    joints = names(model, "joint", model.njnt)
    driven = set(scene.posture)
    assert set(joints) == driven | {scene.object.name}
    motors = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
    assert sorted(motors) == sorted(driven)
    for robot in scene.robots:
        official = robot_spec(robot.model).compile()
        motor_of = {
            official.joint(int(j)).name: i for i, j in enumerate(official.actuator_trnid[:, 0])
        }
        for name in robot.posture:
            i = motors.index(robot.prefix + name)
            limits = official.actuator(motor_of[name]).ctrlrange
            np.testing.assert_array_equal(model.actuator(i).ctrlrange, limits)
            joint = model.joint(robot.prefix + name)
            np.testing.assert_array_equal(joint.range, official.joint(name).range)
            assert joint.damping == official.joint(name).damping


def based(scene, base):
    """The scene with all its robots at a base."""
    return replace(scene, robots=tuple(replace(robot, base=base) for robot in scene.robots))


def robot_bodies(model, robot, prefix=""):
    """Mass and, with all joints at 0, position of each of the robot's bodies [kg, m]."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    mujoco.mj_kinematics(model, data)
    bodies = [prefix + name for name in names(robot, "body", robot.nbody)[1:]]
    return np.array([[*model.body(b).mass, *data.body(b).xpos] for b in bodies])


@each_scenario
def test_locking_joints_leaves_masses_and_places_at_angle_zero(scene):
    model = compose(based(scene, Pose()), ObjectMotion.POSED).compile()
    for robot in scene.robots:
        spec = robot_spec(robot.model)
        alone = spec.compile()
        expected = robot_bodies(alone, alone)
        found = robot_bodies(model, alone, robot.prefix)
        # The same numbers added up in the same order.
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
        # A body a millimetre off is caught.
        spec.bodies[-1].pos[0] += 1e-3
        assert np.abs(robot_bodies(spec.compile(), alone) - expected).max() > 0.9e-3


def test_hands_sit_on_their_mounts_and_turn_with_them():
    model = composed("box-tilt")
    for hand in BOX.hands:
        body = model.body(hand_body(hand))
        assert model.body(body.parentid[0]).name == hand.mount
        np.testing.assert_array_equal(body.pos, hand.mount_pose.position)
        np.testing.assert_array_equal(body.quat, hand.mount_pose.quaternion)
        assert model.geom(tip_geom(hand)).bodyid == body.id
        assert model.site(tip_site(hand)).bodyid == body.id


def test_base_pose_carries_the_whole_robot_and_nothing_else():
    base = Pose((0.1, -0.2, 0.3), (np.cos(0.2), 0.0, np.sin(0.2), 0.0))
    moved = compose(based(BOX, base)).compile()
    model = composed("box-tilt")
    turn = Rotation.from_quat(base.quaternion, scalar_first=True).as_matrix()
    here, there = mujoco.MjData(model), mujoco.MjData(moved)
    mujoco.mj_kinematics(model, here)
    mujoco.mj_kinematics(moved, there)
    for i in range(1, model.nbody):
        expected = here.xpos[i]
        if model.body(i).name != "box":
            expected = turn @ expected + base.position
        # A chain of ten frames at 1 m.
        np.testing.assert_allclose(there.xpos[i], expected, rtol=0, atol=1e-14)


def test_a_posed_object_has_no_joint_and_no_contacts():
    model = compose(BOX, ObjectMotion.POSED).compile()
    assert model.body("box").mocapid[0] == 0
    assert model.njnt == len(BOX.posture)
    assert model.npair == 0
