"""MuJoCo's inverse dynamics of a scenario's scene, as a check of plans that never used MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.model.contacts import ContactFrames
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.scene import compose, hand_body
from fulcrum.sim.planning.plan import Moment


class InverseDynamics:
    """Robot and object without contacts; what holds them is applied from outside."""

    def __init__(self, scenario):
        self._model = model = compose(scenario).compile()
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self._data = mujoco.MjData(model)
        self._path, self._frames = ScrewPath(scenario.path), ContactFrames(scenario)
        joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
        self._q, self._v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        free = model.joint(scenario.object.name)
        self._pose, self._twist = int(free.qposadr[0]), int(free.dofadr[0])
        self._object = model.body(scenario.object.name).id
        self._hands = [model.body(hand_body(hand)).id for hand in scenario.hands]

    def forces(self, moment):
        """What the motion needs, and what wrenches and torques give: joints (l,), object (6,)."""
        model, data = self._model, self._data
        R_WO, p_WO = self._set(moment)
        mujoco.mj_inverse(model, data)
        given = np.zeros(model.nv)
        given[self._v] = moment.tau
        places = self._frames.points(R_WO, p_WO)
        for i, (R, p, w) in enumerate(
            zip(self._frames.in_world(R_WO), places, moment.w_OC_C, strict=True)
        ):
            force, torque = R @ w[:3], R @ w[3:]
            mujoco.mj_applyFT(model, data, force, torque, p, self._object, given)
            if i < len(self._hands):
                mujoco.mj_applyFT(model, data, -force, -torque, p, self._hands[i], given)
        own = slice(self._twist, self._twist + 6)
        needed = data.qfrc_inverse
        return (needed[self._v].copy(), given[self._v]), (needed[own].copy(), given[own])

    def torques(self, moment):
        """Joint torques that the motion needs with the moment's wrenches at the hands, (l,)."""
        (needed, given), _ = self.forces(moment)
        return needed - given + moment.tau

    def _set(self, moment):
        data, tilt, axis = self._data, moment.tilt, self._path.direction
        R_WO, p_WO = self._path.pose(tilt)
        slope, curvature = self._path.derivatives(tilt, np.zeros(3))
        data.qpos[self._q], data.qvel[self._v] = moment.q, moment.qd
        data.qacc[self._v] = moment.qdd
        pose, twist = self._pose, self._twist
        data.qpos[pose : pose + 3] = p_WO
        quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
        data.qpos[pose + 3 : pose + 7] = quaternion
        # A free joint's velocity: linear in the world, angular in the body's axes.
        data.qvel[twist : twist + 3] = slope * moment.rate
        data.qvel[twist + 3 : twist + 6] = R_WO.T @ axis * moment.rate
        data.qacc[twist : twist + 3] = slope * moment.acceleration + curvature * moment.rate**2
        data.qacc[twist + 3 : twist + 6] = R_WO.T @ axis * moment.acceleration
        return R_WO, p_WO


def at_stations(plan):
    """The plan at both ends of every interval, each with that interval's acceleration."""
    found = plan.solution
    end = np.radians(plan.scenario.path.angle_deg)
    for k, (a, b) in enumerate(zip(*found.motion, strict=True)):
        s, rate = found.problem.s[found.problem.stations[k, 0]], np.sqrt(b)
        slope, curvature = plan.q(s, 1), plan.q(s, 2)
        yield Moment(
            tilt=s * end,
            rate=rate * end,
            acceleration=a * end,
            q=plan.q(s),
            qd=slope * rate,
            qdd=slope * a + curvature * b,
            w_OC_C=found.w_OC_C[0][k],
            tau=found.tau[0][k],
        )
