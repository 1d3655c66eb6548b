"""Drake's bodies are those of the compiled scene, as are Pinocchio's."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.model.robot_model import pinocchio_model
from fulcrum.sim.model.scene import compose, tip_site
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError

pytest.importorskip("pydrake", reason="drake is not installed (pip install .[drake])")

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable

from fulcrum.sim.plant.drake_model import Bodies
from fulcrum.sim.plant.truth import make_true

# Sums of some hundred products of numbers up to 100.
ROUNDING = 1e-10
SCENES = ("box-tilt", "panda-box", "ur5-box", "cylinder-tilt")


class Both:
    """The robots of a compiled scene in Drake and in Pinocchio, at drawn joint angles."""

    def __init__(self, scene, armature=0.0):
        scene.dof_armature[:] += armature
        self.plant = MultibodyPlant(1e-3)
        self.bodies = Bodies(self.plant, scene)
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.model = pinocchio_model(scene)
        self.data = self.model.createData()
        names = list(self.bodies.joints)
        joints = [self.bodies.joints[name] for name in names]
        self.v = [joint.velocity_start() for joint in joints]
        self.order = [self.model.joints[self.model.getJointId(name)].idx_v for name in names]
        q = np.random.default_rng(0).uniform(-1.0, 1.0, len(names))
        positions = self.plant.GetPositions(self.context)
        positions[[joint.position_start() for joint in joints]] = q
        self.plant.SetPositions(self.context, positions)
        self.q = np.zeros(self.model.nq)
        self.q[self.order] = q

    def mass(self):
        ours = self.plant.CalcMassMatrix(self.context)[np.ix_(self.v, self.v)]
        theirs = pin.crba(self.model, self.data, self.q)
        theirs = np.triu(theirs) + np.triu(theirs, 1).T
        return ours, theirs[np.ix_(self.order, self.order)]

    def gravity(self):
        ours = -self.plant.CalcGravityGeneralizedForces(self.context)[self.v]
        theirs = pin.computeGeneralizedGravity(self.model, self.data, self.q)
        return ours, theirs[self.order]

    def jacobian(self, scene, hand):
        site = scene.site(tip_site(hand))
        place = self.bodies.place(int(site.bodyid[0]), site.pos, site.quat)
        world = self.plant.world_frame()
        ours = self.plant.CalcJacobianSpatialVelocity(
            self.context,
            JacobianWrtVariable.kV,
            place.body.body_frame(),
            place.X_BG.translation(),
            world,
            world,
        )[:, self.v]
        frame = self.model.getFrameId(tip_site(hand))
        theirs = pin.computeFrameJacobian(
            self.model, self.data, self.q, frame, pin.LOCAL_WORLD_ALIGNED
        )
        return ours[[3, 4, 5, 0, 1, 2]], theirs[:, self.order]


@pytest.mark.parametrize("name", SCENES)
def test_mass_gravity_and_jacobians_are_pinocchios(name):
    chosen = scenario(name)
    scene = compose(chosen).compile()
    both = Both(scene)
    np.testing.assert_allclose(*both.mass(), rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(*both.gravity(), rtol=0.0, atol=ROUNDING)
    for hand in chosen.hands:
        np.testing.assert_allclose(*both.jacobian(scene, hand), rtol=0.0, atol=ROUNDING)


def test_a_heavier_link_is_caught():
    chosen = scenario("panda-box")
    scene = compose(chosen).compile()
    both = Both(scene)
    heavier = compose(chosen).compile()
    heavier.body_mass[heavier.body("left_panda_link5").id] *= 1.001
    ours, _ = both.mass()
    theirs, _ = Both(heavier).mass()
    assert np.abs(ours - theirs).max() > 1e3 * ROUNDING


def test_armature_is_reflected_inertia():
    scene = compose(scenario("panda-box")).compile()
    without, _ = Both(scene).mass()
    ours, theirs = Both(scene, armature=0.1).mass()
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(ours - without, 0.1 * np.eye(len(ours)), rtol=0.0, atol=ROUNDING)


def test_a_spring_at_a_joint_is_refused():
    scene = compose(scenario("panda-box")).compile()
    scene.jnt_stiffness[0] = 1.0
    with pytest.raises(InvalidInputError, match="a spring"):
        Bodies(MultibodyPlant(1e-3), scene)


def test_what_a_world_changes_in_the_scene_is_changed_here():
    chosen = scenario("panda-box")
    scene = compose(chosen).compile()
    before, _ = Both(scene).mass()
    world = replace(World(), link_mass=(1.1,) * 14)
    changed = compose(chosen).compile()
    make_true(changed, chosen, world)
    after, pinocchios = Both(changed).mass()
    assert np.abs(after - before).max() > 0.01
    np.testing.assert_allclose(after, pinocchios, rtol=0.0, atol=ROUNDING)
