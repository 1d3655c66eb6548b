"""Drake's plant does what physics says: weight, stiffness, friction, torsion, motors, pushes."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.object import GRAVITY, homogeneous
from fulcrum.sim.geometry.shapes import MeshShape
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.scenario.material import SUPPORT, ContactMaterial
from fulcrum.sim.signals.force import AppliedForce
from fulcrum.sim.signals.trace import Trace
from fulcrum.sim.world.world import NO_DEVIATION, World

pytest.importorskip("pydrake", reason="drake is not installed (pip install .[drake])")

from fulcrum.sim.plant.drake import DrakePlant

PANDA = scenario("panda-box")
WEIGHT = PANDA.object.mass * GRAVITY
ROBOT = RobotModel(PANDA)
START = plan_joints(PANDA).start
CONTACTS = len(PANDA.contact_names)


def resting(world=NO_DEVIATION, steps=200, forces=(), edge=SUPPORT, tau=None, believed=PANDA):
    """The plant after some steps with the arms held up, and the block of these steps."""
    supports = tuple(replace(support, material=edge) for support in believed.supports)
    rests = tuple(replace(rest, material=edge) for rest in believed.rests)
    believed = replace(believed, supports=supports, rests=rests)
    plant = DrakePlant(world.truth(believed), world)
    plant.reset(START)
    block = Trace.allocate(steps, len(START), len(PANDA.hands), CONTACTS)
    for row in range(steps):
        measured = plant.measure()
        block.p_WO[row], block.quat_WO[row] = measured.p_WO, measured.quat_WO
        block.q[row], block.qd[row] = measured.q, measured.qd
        plant.apply(ROBOT.at(measured.q).tau_g if tau is None else tau, forces)
        plant.step()
    plant.contacts(block)
    return plant, block


def test_the_table_carries_half_the_weight_at_the_edge_that_is_named():
    _, block = resting()
    # The object stands level: its four corners carry a quarter each, and two of them are supports.
    np.testing.assert_allclose(block.f_W[-1, 2:, 2], WEIGHT / 4.0, rtol=1e-3)
    np.testing.assert_allclose(block.f_W[-1, :2], 0.0)
    assert np.isnan(block.p_WC[-1, :2]).all()
    assert np.isfinite(block.p_WC[-1, 2:]).all()


@pytest.mark.parametrize("stiffness", [1e5, 4e5])
def test_the_depth_is_force_over_stiffness(stiffness):
    _, block = resting(edge=ContactMaterial(stiffness, 5e-3))
    depth = PANDA.path.start.position[2] - block.p_WO[-1, 2]
    assert depth == pytest.approx(WEIGHT / 4.0 / stiffness, rel=2e-3)


def test_a_mesh_touches_with_the_corners_of_its_hull(tmp_path):
    file = tmp_path / "cuboid.stl"
    trimesh.creation.box(PANDA.object.shape.size).export(file)
    mesh = homogeneous("box", MeshShape(str(file)), PANDA.object.mass)
    _, block = resting(believed=replace(PANDA, object=mesh))
    _, exact = resting()
    np.testing.assert_allclose(
        block.f_W[-1], exact.f_W[-1], atol=1e-3
    )  # N; STL has single precision


@pytest.mark.parametrize("name", ["cylinder-side", "cylinder-tilt"])
def test_the_surface_carries_all_of_a_cylinders_weight(name):
    lying = scenario(name)
    plant = DrakePlant(lying)
    start = plan_joints(lying).start
    plant.reset(start)
    robot = RobotModel(lying)
    for _ in range(300):
        plant.apply(robot.at(plant.measure().q).tau_g)
        plant.step()
    p_WO = plant.measure().p_WO
    # It neither falls nor rolls: its points sink in by less than the edge's stiffness allows.
    assert np.abs(p_WO[:2] - lying.path.start.position[:2]).max() < 1e-5
    sunk = lying.path.start.position[2] - p_WO[2]
    assert 0.0 < sunk <= 1.01 * lying.object.mass * GRAVITY / 2.0 / SUPPORT.stiffness


def test_mass_and_place_of_the_object_are_the_worlds():
    _, block = resting(World(mass=1.2))
    np.testing.assert_allclose(block.f_W[-1, 2:, 2], 1.2 * WEIGHT / 4.0, rtol=1e-3)
    _, shifted = resting(World(center_of_mass=(-0.05, 0.0, 0.0)))
    # 0.05 m towards the edge, of 0.5 m between the edges.
    np.testing.assert_allclose(shifted.f_W[-1, 2:, 2], 0.6 * WEIGHT / 2.0, rtol=1e-3)


@pytest.mark.parametrize(("share", "slides"), [(0.9, False), (1.1, True)])
def test_friction_holds_up_to_the_cone(share, slides):
    mu = PANDA.supports[0].friction.mu
    push = AppliedForce(np.array([0.0, share * mu * WEIGHT, 0.0]), None)
    _, block = resting(forces=[push])
    moved = abs(block.p_WO[-1, 1] - block.p_WO[0, 1])
    # 0.1 mu g for 0.2 s gives 8 mm; what sticks creeps by some micrometres.
    assert (moved > 2e-3) if slides else (moved < 5e-5)


def test_a_push_without_a_point_acts_at_the_centre_of_mass():
    world = World(center_of_mass=(0.05, 0.0, 0.0))
    up = np.array([0.0, 0.0, 1.5 * WEIGHT])
    _, block = resting(world, steps=50, forces=[AppliedForce(up, None)])
    np.testing.assert_allclose(block.twist_WO[-1, 3:], 0.0, atol=1e-6)
    # 49 steps; gravity takes one weight of the push.
    assert block.twist_WO[-1, 2] == pytest.approx(0.5 * GRAVITY * 0.049, rel=1e-3)
    at_frame = AppliedForce(up, np.zeros(3))
    _, turned = resting(world, steps=50, forces=[at_frame])
    assert abs(turned.twist_WO[-1, 4]) > 0.1


def test_motors_saturate():
    plant, _ = resting(steps=1, tau=1e4 * np.ones(len(START)))
    np.testing.assert_allclose(plant.measure().tau, ROBOT.tau_max)


@pytest.mark.parametrize(("share", "moves"), [(0.95, False), (1.2, True)])
def test_dry_friction_holds_a_joint(share, moves):
    """The first joint turns about the vertical, so that gravity does not move it."""
    dry = 2.0
    world = World(joint_friction=(dry,) * len(START))
    push = np.zeros(len(START))
    push[0] = share * dry
    _, block = resting(world, steps=100, tau=ROBOT.at(START).tau_g + push)
    # 0.4 N m move some kg m^2 for 0.1 s.
    assert bool(abs(block.qd[-1, 0]) > 5e-3) is moves
    if not moves:
        assert abs(block.qd[-1, 0]) < 2.1 * dry / 1e5  # damping of the brake


def test_the_same_torques_give_the_same_run():
    first, second = resting(steps=50)[1], resting(steps=50)[1]
    np.testing.assert_array_equal(first.f_W, second.f_W)
    np.testing.assert_array_equal(first.q, second.q)


def test_tips_and_their_twists_are_those_of_the_controllers_model():
    tau = np.linspace(-5.0, 5.0, len(START))
    _, block = resting(steps=30, tau=ROBOT.at(START).tau_g + tau)
    robot = ROBOT.at(block.q[-1])
    np.testing.assert_allclose(block.p_WE[-1], robot.tips(), atol=1e-12)
    R = np.broadcast_to(np.eye(3), (2, 3, 3))
    twist = robot.contact_jacobians(block.p_WE[-1], R) @ block.qd[-1]
    assert np.abs(twist).max() > 1e-3
    np.testing.assert_allclose(block.twist_WE[-1], twist, atol=1e-9)


def test_what_must_not_touch_is_told():
    # The left arm folds into itself and onto the table by a torque at its second joint.
    low = replace(PANDA, environment=PANDA.environment)
    plant = DrakePlant(low)
    plant.reset(START)
    tau = np.zeros(len(START))  # the arms fall
    for _ in range(1500):
        plant.apply(tau)
        plant.step()
    assert plant.collisions
    (first, second), t = next(iter(plant.collisions.items()))
    assert "panda" in f"{first} {second}"
    assert t > 0.0
