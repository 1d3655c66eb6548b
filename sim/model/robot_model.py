"""The controller's model of the robots: arms, hands and limits in Pinocchio.

The model is read from the nominal scene, so hands, locked joints and the robots' bases need no
second description. A test compares the robots with their official URDF.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin

from fulcrum.assets import velocity_limits
from fulcrum.sim.model.scene import compose, joint_ranges, tip_geom, tip_site
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis import InvalidInputError, Joints
from fulcrum.synthesis.arrays import Array


class RobotModel:
    """Kinematics, gravity and limits of the driven joints, in the order of the scene's motors.

    Attributes:
        joints: Names of the l driven joints.
        q_min, q_max: Limits of the joint angles [rad or m], (l,).
        qd_max: Speed limits [rad/s or m/s], (l,).
        tau_min, tau_max: Torque limits [N·m or N], (l,).
        damping: Viscous joint friction [N·m·s/rad], (l,).
        start_deviation: Standard deviation of the start posture [rad or m], (l,).
        tip_radii: Radii of the hands' tips [m], (n,).
    """

    def __init__(self, scenario: Scenario) -> None:
        scene = compose(scenario).compile()
        drives = [scene.actuator(i) for i in range(scene.nu)]
        indices = [int(drive.trnid[0]) for drive in drives]
        self.joints = tuple(scene.joint(i).name for i in indices)
        self.q_min, self.q_max = joint_ranges(scene)[indices].T.copy()
        speeds = velocity_limits(scene)
        self.qd_max = np.array([speeds[name] for name in self.joints])
        self.tau_min, self.tau_max = np.array([drive.ctrlrange for drive in drives]).T.copy()
        self.damping = scene.dof_damping[scene.jnt_dofadr[indices]].copy()

        self.start_deviation = np.array([scenario.start_deviation[name] for name in self.joints])

        self._model = pinocchio_model(scene)
        # Pinocchio may order joints differently; every vector here is in the order of the motors.
        order = [self._model.joints[self._model.getJointId(name)].idx_v for name in self.joints]
        self._order = np.array(order)
        # Indices into Pinocchio's mass matrix, of which only the upper triangle is valid.
        first, second = np.minimum.outer(order, order), np.maximum.outer(order, order)
        self._mass_entries = first * self._model.nv + second
        tips = [self._frame(tip_site(hand)) for hand in scenario.hands]
        self._tip_joints = [int(self._model.frames[tip].parentJoint) for tip in tips]
        self._tip_places = [self._model.frames[tip].placement.translation.copy() for tip in tips]
        self.tip_radii = np.array([scene.geom(tip_geom(h)).size[0] for h in scenario.hands])
        # Pinocchio's work space for motion, and the free ones, of states no longer in use.
        self._moving = self._model.createData()
        self._spare: list[pin.Data] = []

    def _frame(self, name: str) -> int:
        if not self._model.existFrame(name):
            frames = ", ".join(frame.name for frame in self._model.frames)
            raise ValueError(f"frame: got {name!r}; valid is one of {frames}.")
        return int(self._model.getFrameId(name))

    def at(self, q: Array) -> RobotState:
        """Return the robots at joint angles q [rad or m], (l,)."""
        return RobotState(self, q)


class RobotState:
    """The robots at one posture; immutable.

    Attributes:
        robot: Model of the robots.
        tau_g: Torques that balance gravity [N·m or N], (l,).
    """

    __slots__ = ("_data", "_q", "robot", "tau_g")

    def __init__(self, robot: RobotModel, q: Array) -> None:
        self.robot = robot
        model, order = robot._model, robot._order
        # Making a new work space of Pinocchio takes longer than the computations in it.
        self._data = robot._spare.pop() if robot._spare else model.createData()
        self._q = np.zeros(model.nq)
        self._q[order] = q
        pin.computeJointJacobians(model, self._data, self._q)
        g = pin.computeGeneralizedGravity(model, self._data, self._q)
        self.tau_g = g.take(order)

    def __del__(self) -> None:
        self.robot._spare.append(self._data)

    def tips(self) -> Array:
        """Return the centres of the hands' tips in the world [m], (n, 3)."""
        places = zip(self.robot._tip_joints, self.robot._tip_places, strict=True)
        return np.array([self._data.oMi[joint].act(place) for joint, place in places])

    def mass_matrix(self) -> Array:
        """Return the joint-space inertia [kg m^2 or kg], (l, l)."""
        robot = self.robot
        return pin.crba(robot._model, self._data, self._q).take(robot._mass_entries)

    def inertial_torques(self, slope: Array, curvature: Array) -> tuple[Array, Array]:
        r"""Return the torques for motion along joint angles q(s).

        Args:
            slope: First derivative q' [rad or m], (l,).
            curvature: Second derivative q'' [rad or m], (l,).

        Returns:
            :math:`M q'` and :math:`M q'' + C(q, q') q'`, (l,) each: torques per :math:`\ddot s` and
            per :math:`\dot s^2`, without viscous friction.
        """
        at_rest = np.zeros_like(slope)
        return self.motion_torques(at_rest, slope), self.motion_torques(slope, curvature)

    def motion_torques(self, qd: Array, qdd: Array) -> Array:
        r"""Return :math:`M \ddot q + C(q, \dot q) \dot q` [N·m or N], (l,)."""
        robot = self.robot
        speeds, accelerations = np.zeros((2, robot._model.nv))
        speeds[robot._order], accelerations[robot._order] = qd, qdd
        tau = pin.rnea(robot._model, robot._moving, self._q, speeds, accelerations)
        return tau.take(robot._order) - self.tau_g

    def contact_jacobians(self, p_WC: Array, R_WC: Array) -> Array:
        """Return the Jacobians of the hands' points at the contacts, in contact axes.

        Args:
            p_WC: Contact points in the world [m], (n, 3).
            R_WC: Contact axes in the world, (n, 3, 3).

        Returns:
            Twists, linear part first, of the hands' points at their contacts per joint speed,
                (n, 6, l).
        """
        robot, data = self.robot, self._data
        J_C = np.empty((len(robot._tip_joints), 6, len(robot.joints)))
        for i, joint in enumerate(robot._tip_joints):
            # The contact as a frame fixed to the tip's joint.
            X_JC = data.oMi[joint].actInv(pin.SE3(R_WC[i], p_WC[i]))
            J = pin.getFrameJacobian(robot._model, data, joint, X_JC, pin.ReferenceFrame.LOCAL)
            J.take(robot._order, axis=1, out=J_C[i], mode="clip")
        return J_C

    def statics(self, p_WC: Array, R_WC: Array) -> Joints:
        """Return the joints' part of the synthesis problem, (15) and (16), at these contacts."""
        robot = self.robot
        return Joints(
            names=robot.joints,
            J_C=self.contact_jacobians(p_WC, R_WC),
            tau_g=self.tau_g,
            tau_min=robot.tau_min,
            tau_max=robot.tau_max,
        )


def pinocchio_model(scene: mujoco.MjModel) -> pin.Model:
    """Return a Pinocchio model of all bodies of a compiled scene on hinges and slides.

    Bodies with a free joint (the object) are left out. Sites become frames of the same names.

    Raises:
        InvalidInputError: A joint is neither a hinge nor a slide.
    """
    model = pin.Model()
    model.gravity.linear = scene.opt.gravity
    joint_of = {0: 0}
    X_JB = {0: pin.SE3.Identity()}
    for body in range(1, scene.nbody):
        parent = int(scene.body_parentid[body])
        first, count = int(scene.body_jntadr[body]), int(scene.body_jntnum[body])
        own = range(first, first + count)
        free = mujoco.mjtJoint.mjJNT_FREE
        if parent not in joint_of or any(scene.jnt_type[j] == free for j in own):
            continue
        joint = joint_of[parent]
        placement = X_JB[parent] * _pose(scene.body_pos[body], scene.body_quat[body])
        for j in own:
            anchor = pin.SE3(np.eye(3), scene.jnt_pos[j])
            hinge = scene.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
            kind = pin.JointModelRevoluteUnaligned if hinge else pin.JointModelPrismaticUnaligned
            name = scene.joint(j).name
            if scene.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
                raise InvalidInputError(f"joint {name}", "a ball joint", "a hinge or a slide")
            joint = model.addJoint(joint, kind(scene.jnt_axis[j]), placement * anchor, name)
            model.armature[model.joints[joint].idx_v] = scene.dof_armature[scene.jnt_dofadr[j]]
            placement = anchor.inverse()
        joint_of[body], X_JB[body] = joint, placement
        model.appendBodyToJoint(
            joint,
            pin.Inertia(
                float(scene.body_mass[body]), np.zeros(3), np.diag(scene.body_inertia[body])
            ),
            placement * _pose(scene.body_ipos[body], scene.body_iquat[body]),
        )
        _add_frame(model, joint, placement, scene.body(body).name)
    for site in range(scene.nsite):
        body = int(scene.site_bodyid[site])
        if body in joint_of:
            placement = X_JB[body] * _pose(scene.site_pos[site], scene.site_quat[site])
            _add_frame(model, joint_of[body], placement, scene.site(site).name)
    return model


def _add_frame(model: pin.Model, joint: int, placement: pin.SE3, name: str) -> None:
    model.addFrame(pin.Frame(name, joint, placement, pin.FrameType.OP_FRAME))


def _pose(position: Sequence[float] | Array, quaternion_wxyz: Sequence[float] | Array) -> pin.SE3:
    w, x, y, z = quaternion_wxyz
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.asarray(position, float))
