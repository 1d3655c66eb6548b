"""The plant: MuJoCo's truth about robot, object and contacts, behind dm_control's Physics."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.contact_log import ContactLog, ContactReader
from sim.scenario import Scenario
from sim.scene import compose, tip_site
from synthesis.contact import Array

with warnings.catch_warnings():  # dm_control looks for a display on import; none is needed
    warnings.simplefilter("ignore")
    from dm_control import mujoco as dm_mujoco
    from dm_control.mujoco import wrapper


@dataclass(frozen=True, eq=False)
class Measurement:
    """What the controller gets to know at one instant.

    Attributes:
        t: Time [s].
        q: Joint angles [rad or m], (l,), in the order of the motors.
        qd: Joint speeds [rad/s or m/s], (l,).
        p_WO: Position of the object [m], (3,).
        quat_WO: Orientation of the object, (4,), wxyz.
    """

    t: float
    q: Array
    qd: Array
    p_WO: Array
    quat_WO: Array


class Plant:
    """Steps the scene and reads it by the scenario's names; the only module that steps MuJoCo.

    After :meth:`step` contact forces, tip and object poses belong to the state *before* the step,
    for which they were computed; :meth:`measure` gives the state after it.

    Attributes:
        physics: dm_control's Physics.
        joints: Names of the driven joints, in the order of the motors.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.physics = dm_mujoco.Physics.from_model(wrapper.MjModel(compose(scenario).compile()))
        self.physics.legacy_step = False  # else new contacts would be read with old forces
        self._model, self._data = self.physics.model.ptr, self.physics.data.ptr
        model = self._model
        joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
        self.joints = tuple(model.joint(j).name for j in joints)
        self._q = model.jnt_qposadr[joints].copy()
        self._qd = model.jnt_dofadr[joints].copy()
        thing = model.body(scenario.object.name)
        free = model.joint(scenario.object.name)
        self._pose = slice(int(free.qposadr[0]), int(free.qposadr[0]) + 7)
        self._object = thing.id
        self._tips = [model.site(tip_site(hand)).id for hand in scenario.hands]
        self._log, self._reader = ContactLog(), ContactReader(scenario, model)
        self._buffer = np.zeros(6)

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Pairs of geoms that touched against the scenario's will, and when first [s]."""
        return self._reader.collisions

    def reset(self, q: Array) -> None:
        """Puts the robot at rest at joint angles q, (l,), and the object at its start."""
        self.collisions.clear()
        with self.physics.reset_context():
            self.place(q)

    def place(self, q: Array) -> None:
        """Sets the joint angles q, (l,), of a state that is being reset."""
        self._data.qpos[self._q] = q

    def apply(self, tau: Array) -> None:
        """Sets the motor torques [N·m or N], (l,), for the next step; the motors saturate."""
        self._data.ctrl[:] = tau

    def step(self) -> None:
        """One physics step.

        Raises:
            dm_control.rl.control.PhysicsError: The state has diverged.
        """
        self.physics.step()

    def measure(self) -> Measurement:
        """The present state."""
        data = self._data
        pose = data.qpos[self._pose].copy()
        return Measurement(
            t=data.time,
            q=data.qpos.take(self._q),
            qd=data.qvel.take(self._qd),
            p_WO=pose[:3],
            quat_WO=pose[3:],
        )

    def tips(self, positions: Array, quaternions: Array, twists: Array) -> None:
        """Writes the hands' tip poses and world twists (linear first), (n, 3 | 4 | 6)."""
        for i, site in enumerate(self._tips):
            positions[i] = self._data.site_xpos[site]
            mujoco.mju_mat2Quat(quaternions[i], self._data.site_xmat[site])
            self._twist(mujoco.mjtObj.mjOBJ_SITE, site, twists[i])

    def object_twist(self, twist: Array) -> None:
        """Writes the world twist of the object frame, linear part first, (6,)."""
        self._twist(mujoco.mjtObj.mjOBJ_XBODY, self._object, twist)

    def _twist(self, kind: mujoco.mjtObj, index: int, twist: Array) -> None:
        mujoco.mj_objectVelocity(self._model, self._data, kind, index, self._buffer, 0)
        twist[:3], twist[3:] = self._buffer[3:], self._buffer[:3]

    def contacts(self, positions: Array, wrenches: Array) -> int:
        """The contacts of the last step, (m, 3) and (m, 4), as :meth:`read_contacts` has them."""
        self._log.count = 0
        self.log_contacts(0)
        p_WO = self._data.xpos[self._object]
        R_WO = self._data.xmat[self._object].reshape(3, 3)
        return int(
            self._reader.read(self._log, p_WO[None], R_WO[None], positions[None], wrenches[None])[0]
        )

    def log_contacts(self, step: int) -> None:
        """Keeps the contacts of the last step, the one of an index in a block, to be read."""
        self._log.append(step, self._model, self._data)

    def read_contacts(self, p_WO: Array, R_WO: Array, positions: Array, wrenches: Array) -> NDArray:
        """Reads the contacts of the block of steps that was logged; see :class:`ContactReader`."""
        collisions = self._reader.read(self._log, p_WO, R_WO, positions, wrenches)
        self._log.count = 0
        return collisions
