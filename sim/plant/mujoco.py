"""The plant: MuJoCo's truth about robot, object and contacts, behind dm_control's Physics."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from dm_control.rl.control import PhysicsError

from fulcrum.sim.model.contacts import rotations
from fulcrum.sim.model.scene import compose
from fulcrum.sim.plant.contact_log import ContactLog, ContactReader
from fulcrum.sim.plant.motion_log import MotionLog
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.signals.trace import Trace
from fulcrum.sim.world.faults import FaultKind, of_kinds
from fulcrum.sim.world.motors import Motors
from fulcrum.sim.world.world import NO_DEVIATION, World
from fulcrum.synthesis.arrays import Array

with warnings.catch_warnings():  # dm_control looks for a display on import; none is needed
    warnings.simplefilter("ignore")
    from dm_control import mujoco as dm_mujoco
    from dm_control.mujoco import wrapper


class Plant:
    """Steps the scene and reads it by the scenario's names; the only module that steps MuJoCo.

    After :meth:`step` contact forces, tip and object poses belong to the state *before* the step,
    for which they were computed; :meth:`measure` gives the state after it. They are read at once,
    or, many times cheaper, logged step by step and read for a whole block; not in turns.

    Attributes:
        physics: dm_control's Physics.
        joints: Names of the driven joints, in the order of the motors.
    """

    def __init__(self, scenario: Scenario, world: World = NO_DEVIATION) -> None:
        """Builds the scene.

        Args:
            scenario: What the plant truly is.
            world: What its robot truly is, and what disturbs it; nothing by default.

        Raises:
            InvalidInputError: Scenario or world contradict themselves or each other.
        """
        self.physics = dm_mujoco.Physics.from_model(wrapper.MjModel(compose(scenario).compile()))
        self.physics.legacy_step = False  # else new contacts would be read with old forces
        self._model, self._data = self.physics.model.ptr, self.physics.data.ptr
        data = self._data
        # Views of what MuJoCo writes, which are slow to ask for one by one.
        self._warnings, self._ctrl = data.warning.number, data.ctrl
        self._numbers = data.qpos, data.qvel, data.actuator_force
        model = self._model
        world.change(scenario, model)
        joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
        self.joints = tuple(model.joint(j).name for j in joints)
        self._q = model.jnt_qposadr[joints].copy()
        thing = model.body(scenario.object.name)
        free = model.joint(scenario.object.name)
        # Where angles, speeds, the object's pose and torques are among the numbers, end to end.
        self._measured = np.concatenate(
            [
                self._q,
                model.nq + model.jnt_dofadr[joints],
                int(free.qposadr[0]) + np.arange(7),
                model.nq + model.nv + np.arange(model.nu),
            ]
        )
        ends = np.cumsum([0, len(joints), len(joints), 3, 4, model.nu]).tolist()
        self._parts = tuple(map(slice, ends[:-1], ends[1:]))
        self._object = thing.id
        self._contacts, self._reader = ContactLog(), ContactReader(scenario, model)
        self._motion = MotionLog(scenario, model, self._data)
        self._motors = Motors(world, model.actuator_ctrlrange[:, 1], self.joints)
        self._pushes = world.pushes
        self._weights = of_kinds(world.faults, FaultKind.WEIGHT)

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Pairs of geoms that touched against the scenario's will, and when first [s]."""
        return self._reader.collisions

    def reset(self, q: Array) -> None:
        """Puts the robot at rest at joint angles q, (l,), and the object at its start."""
        with self.physics.reset_context():
            self.place(q)

    def place(self, q: Array) -> None:
        """Sets the joint angles q, (l,), of a state that is being reset; forgets collisions."""
        self.collisions.clear()
        self._data.qpos[self._q] = q

    def apply(self, tau: Array) -> None:
        """Commands the motor torques [N·m or N], (l,), for the next step; the motors saturate."""
        self._ctrl[:] = self._motors.torques(self._data.time, tau)

    def step(self) -> None:
        """One physics step.

        Raises:
            PhysicsError: The state has diverged.
        """
        if self._pushes or self._weights:
            self._push()
        # As dm_control's own step, whose search for warnings takes a sixth as long as the step.
        mujoco.mj_step(self._model, self._data)
        if np.count_nonzero(self._warnings):
            names = np.compress(self._warnings, list(mujoco.mjtWarning.__members__))
            raise PhysicsError(f"the state has diverged: {', '.join(names)}.")

    def _push(self) -> None:
        """Applies the pushes of this instant at their points on the object, and extra weight."""
        data, body = self._data, self._object
        wrench = data.xfrc_applied[body]
        wrench[:] = 0.0
        for push in self._pushes:
            if push.t <= data.time < push.t + push.duration_s:
                R_WO = data.xmat[body].reshape(3, 3)
                arm = data.xpos[body] + R_WO @ push.p_OA_O - data.xipos[body]
                wrench[:3] += push.force_W
                wrench[3:] += np.cross(arm, push.force_W)
        for fault in self._weights:
            if fault.active(data.time):
                wrench[2] -= fault.extra_n

    def measure(self) -> Measurement:
        """The present state."""
        numbers = np.concatenate(self._numbers).take(self._measured)
        q, qd, p_WO, quat_WO, tau = self._parts
        return Measurement(
            self._data.time, numbers[q], numbers[qd], numbers[p_WO], numbers[quat_WO], numbers[tau]
        )

    def tips(self, positions: Array, quaternions: Array, twists: Array) -> None:
        """Writes the hands' tip poses and world twists (linear first), (n, 3 | 4 | 6)."""
        self._motion.append(0)
        self._motion.tips(positions[None], quaternions[None], twists[None])

    def object_twist(self, twist: Array) -> None:
        """Writes the world twist of the object frame, linear part first, (6,)."""
        self._motion.append(0)
        self._motion.object_twist(twist[None])

    def contacts(self, positions: Array, wrenches: Array) -> int:
        """Adds up the plant's contacts; see :meth:`ContactReader.read`, here of one step."""
        self._contacts.clear()
        self._contacts.append(self._data)
        R_WO = self._data.xmat[self._object].reshape(1, 3, 3)
        collisions = self._reader.read(
            self._contacts,
            self._data.xpos[self._object][None],
            R_WO,
            positions[None],
            wrenches[None],
        )
        return int(collisions[0])

    def log(self, step: int) -> None:
        """Keeps the last step, of an index in a block of steps, to be read with the block."""
        self._contacts.append(self._data)
        self._motion.append(step)

    def read(self, block: Trace) -> None:
        """Fills a block's columns on tips, contacts and the object's twist from what was logged.

        Where a contact is not touched, its place becomes NaN.
        """
        self._motion.tips(block.p_WE, block.quat_WE, block.twist_WE)
        self._motion.object_twist(block.twist_WO)
        block.p_WC[:] = np.nan
        block.collisions[:] = self._reader.read(
            self._contacts, block.p_WO, rotations(block.quat_WO), block.p_WC, block.f_W
        )
        self._contacts.clear()
