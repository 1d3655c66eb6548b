"""A compiled scene's robots and object as bodies and joints of Drake's MultibodyPlant.

They are read from MuJoCo's compiled model, as is the controller's Pinocchio model. So any URDF or
MJCF works with both engines, and a world's changes to the compiled model apply here, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JointActuator,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
)

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array

# Dry friction is a damper that is stiff enough to stick, with a limited torque [N·m·s/rad].
_BRAKE_DAMPING = 1e5
# Mass [kg] and size [m] of a pad, without influence; inertia of its hinges [kg·m²], large enough
# that SAP does not regularise its contacts for a light body; gains of a spring of a few N·mm.
_PAD_SPHERE = (1e-4, 0.01)
_PAD_INERTIA = 0.05
_PAD_GAINS = PdControllerGains(p=0.5, d=0.3)
_JOINTS = {
    int(mujoco.mjtJoint.mjJNT_HINGE): RevoluteJoint,
    int(mujoco.mjtJoint.mjJNT_SLIDE): PrismaticJoint,
}


@dataclass(frozen=True)
class Mount:
    """A place in the scene: the body that carries it, and the pose on that body."""

    body: RigidBody
    X_BG: RigidTransform


class Bodies:
    """All bodies of a compiled scene, added to a MultibodyPlant that is not yet finalised.

    Bodies without joints are merged with the bodies that carry them.

    Attributes:
        joints: Drake's joints by name.
        motors: Actuators by joint name; each has the armature of its joint.
        controlled: Whether there are actuators with gains, for dry friction or pads.
    """

    def __init__(self, plant: MultibodyPlant, scene: mujoco.MjModel) -> None:
        """Add the bodies.

        Raises:
            InvalidInputError: A joint has a kind or a spring that is not modelled here.
        """
        self._plant, self._scene = plant, scene
        self.joints: dict[str, RevoluteJoint | PrismaticJoint] = {}
        self.motors: dict[str, JointActuator] = {}
        self.controlled = False
        # For each of the scene's bodies the body that it moves with, and its pose there.
        self._carriers = {0: (0, RigidTransform())}
        for body in range(1, scene.nbody):
            self._carriers[body] = self._carrier(body)
        inertias = self._inertias()
        self._links = {0: plant.world_body()}
        for body in range(1, scene.nbody):
            if self._carriers[body][0] == body:
                self._add(body, inertias[body])
        plant.mutable_gravity_field().set_gravity_vector(scene.opt.gravity)

    def place(self, body: int, position: Array, quaternion: Array) -> Mount:
        """Return the place of a geom or site from its pose on one of the scene's bodies."""
        carrier, X_LB = self._carriers[body]
        return Mount(self._links[carrier], X_LB @ pose(position, quaternion))

    def add_pad(self, name: str, place: Mount) -> RigidBody:
        """Add a body on two hinges, about x and y of a place, held upright by a weak spring."""
        plant, parent = self._plant, place.body
        frame = plant.AddFrame(FixedOffsetFrame(f"{name}/pad", parent.body_frame(), place.X_BG))
        for axis in np.eye(3)[:2]:
            label = f"{name}/pad/{'xy'[int(axis[1])]}"
            body = plant.AddRigidBody(label, SpatialInertia.SolidSphereWithMass(*_PAD_SPHERE))
            joint = plant.AddJoint(RevoluteJoint(label, frame, body.body_frame(), axis, 0.0))
            spring = plant.AddJointActuator(label, joint)
            spring.set_default_rotor_inertia(_PAD_INERTIA)
            spring.set_default_gear_ratio(1.0)
            spring.set_controller_gains(_PAD_GAINS)
            frame = body.body_frame()
        self.controlled = True
        return body

    def _carrier(self, body: int) -> tuple[int, RigidTransform]:
        scene = self._scene
        count = int(scene.body_jntnum[body])
        if not count:
            carrier, X_LP = self._carriers[int(scene.body_parentid[body])]
            return carrier, X_LP @ pose(scene.body_pos[body], scene.body_quat[body])
        last = int(scene.body_jntadr[body]) + count - 1
        if scene.jnt_type[last] == mujoco.mjtJoint.mjJNT_FREE:
            return body, RigidTransform()
        return body, RigidTransform(-scene.jnt_pos[last])

    def _inertias(self) -> dict[int, SpatialInertia]:
        """Return the inertia of each group of bodies that move as one, in its carrier's frame."""
        scene, sums = self._scene, dict[int, SpatialInertia]()
        for body, (carrier, X_LB) in self._carriers.items():
            mass = float(scene.body_mass[body])
            if mass <= 0.0:
                continue
            X_LI = X_LB @ pose(scene.body_ipos[body], scene.body_iquat[body])
            central = RotationalInertia(*scene.body_inertia[body]).ReExpress(X_LI.rotation())
            own = SpatialInertia.MakeFromCentralInertia(mass, X_LI.translation(), central)
            if carrier in sums:
                own += sums[carrier]
            sums[carrier] = own
        return {body: sums.get(body, SpatialInertia.Zero()) for body in range(scene.nbody)}

    def _add(self, body: int, inertia: SpatialInertia) -> None:
        """Add one of the scene's bodies that have joints of their own."""
        scene, plant = self._scene, self._plant
        name, first = scene.body(body).name, int(scene.body_jntadr[body])
        link = plant.AddRigidBody(name, inertia)
        self._links[body] = link
        if scene.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE:
            return
        place = self.place(
            int(scene.body_parentid[body]), scene.body_pos[body], scene.body_quat[body]
        )
        parent, at = place.body, place.X_BG
        last = first + int(scene.body_jntnum[body]) - 1
        for j in range(first, last):
            between = plant.AddRigidBody(f"{name}/{j}", SpatialInertia.Zero())
            self._join(j, parent, at @ RigidTransform(scene.jnt_pos[j]), between)
            parent, at = between, RigidTransform(-scene.jnt_pos[j])
        self._join(last, parent, at @ RigidTransform(scene.jnt_pos[last]), link)

    def _join(self, j: int, parent: RigidBody, X_PF: RigidTransform, child: RigidBody) -> None:
        """Add one of the scene's joints, with damping, limits, armature and dry friction."""
        scene, plant = self._scene, self._plant
        name, dof, kind = scene.joint(j).name, int(scene.jnt_dofadr[j]), int(scene.jnt_type[j])
        if kind not in _JOINTS:
            raise InvalidInputError(f"joint {name}", "a ball joint", "a hinge or a slide")
        if scene.jnt_stiffness[j] != 0.0:
            raise InvalidInputError(f"joint {name}", "a spring", "none with Drake")
        frame = plant.AddFrame(FixedOffsetFrame(f"{name}/base", parent.body_frame(), X_PF))
        axis, damping = scene.jnt_axis[j], float(scene.dof_damping[dof])
        joint = plant.AddJoint(
            _JOINTS[kind](name, frame, child.body_frame(), axis, damping=damping)
        )
        if scene.jnt_limited[j]:
            low, high = scene.jnt_range[j].tolist()
            joint.set_position_limits([low], [high])
        motor = plant.AddJointActuator(name, joint)
        motor.set_default_rotor_inertia(float(scene.dof_armature[dof]))
        motor.set_default_gear_ratio(1.0)
        self.joints[name], self.motors[name] = joint, motor
        friction = float(scene.dof_frictionloss[dof])
        if friction > 0.0:
            brake = plant.AddJointActuator(f"{name}/brake", joint, friction)
            brake.set_controller_gains(PdControllerGains(p=0.0, d=_BRAKE_DAMPING))
            self.controlled = True


def pose(position: Array, quaternion: Array) -> RigidTransform:
    """Return the pose with a position [m], (3,), and a quaternion wxyz, (4,)."""
    unit = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return RigidTransform(Quaternion(unit), np.asarray(position, float))
