"""The plant in MuJoCo, through dm_control's Physics."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control.rl.control import PhysicsError

from fulcrum.sim.model import compose, pair_materials, rotations, set_stiffness
from fulcrum.sim.plant.centripetal import Centripetal
from fulcrum.sim.plant.contact_log import ContactLog, ContactReader
from fulcrum.sim.plant.motion_log import MotionLog
from fulcrum.sim.plant.protocol import DivergedError
from fulcrum.sim.plant.truth import make_true
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import AppliedForce, Measurement, Trace
from fulcrum.sim.world import NO_DEVIATION, World
from fulcrum.synthesis.arrays import Array

with warnings.catch_warnings():  # dm_control warns on import if there is no display
    warnings.simplefilter("ignore")
    from dm_control import mujoco as dm_mujoco
    from dm_control.mujoco import wrapper


class _Physics(dm_mujoco.Physics):
    """dm_control's Physics whose steps are those of the plant."""

    centripetal: Centripetal

    def step(self, nstep: int = 1) -> None:
        """Make steps of the plant; see dm_control."""
        with self.check_invalid_state():
            for _ in range(nstep):
                self.advance()

    def advance(self) -> None:
        """Make one step without dm_control's check for warnings, which adds a sixth of the time."""
        model, data = self.model.ptr, self.data.ptr
        mujoco.mj_step1(model, data)
        self.centripetal.add(data)
        mujoco.mj_step2(model, data)


class MujocoPlant:
    """A scenario's truth in MuJoCo; implements :class:`sim.plant.protocol.Plant`.

    After :meth:`step`, contact forces, tip and object poses are those of the state *before* the
    step; :meth:`measure` returns the state after it.

    Attributes:
        physics: Physics of dm_control.
        joints: Names of the driven joints, in the order of the motors.
    """

    def __init__(self, scenario: Scenario, world: World = NO_DEVIATION) -> None:
        """Build the scene.

        Args:
            scenario: True object, contacts and environment.
            world: True deviations of the robots; none by default.

            Raises:
                InvalidInputError: Scenario and world are inconsistent.
        """
        self.physics = _Physics.from_model(wrapper.MjModel(compose(scenario).compile()))
        self.physics.legacy_step = False  # otherwise new contacts are read with old forces
        self._model, self._data = self.physics.model.ptr, self.physics.data.ptr
        data, model = self._data, self._model
        # Views of MuJoCo's arrays, which are slow to access one by one.
        self._warnings, self._ctrl = data.warning.number, data.ctrl
        self._numbers = data.qpos, data.qvel, data.actuator_force
        make_true(model, scenario, world)
        set_stiffness(model, pair_materials(scenario))
        self.physics.centripetal = Centripetal(scenario, model)
        joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
        self.joints = tuple(model.joint(j).name for j in joints)
        self._q = model.jnt_qposadr[joints].copy()
        free = model.joint(scenario.object.name)
        # Ends of angles, speeds, the object's pose and torques in the concatenated numbers.
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
        self._object = model.body(scenario.object.name).id
        self._pushed = False
        self._contacts, self._reader = ContactLog(), ContactReader(scenario, model)
        self._motion = MotionLog(scenario, model, self._data)

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Time of the first contact [s] of each unwanted pair of geoms."""
        return self._reader.collisions

    def reset(self, q: Array) -> None:
        """See :meth:`Plant.reset`."""
        try:
            with self.physics.reset_context():
                self.place(q)
        except PhysicsError as error:
            raise DivergedError(0.0) from error

    def place(self, q: Array) -> None:
        """Set the joint angles q, (l,), of a state that is being reset; forget the logged steps."""
        self.collisions.clear()
        self._contacts.clear()
        self._motion.clear()
        self._data.qpos[self._q] = q

    def measure(self) -> Measurement:
        """See :meth:`Plant.measure`."""
        numbers = np.concatenate(self._numbers).take(self._measured)
        q, qd, p_WO, quat_WO, tau = self._parts
        return Measurement(
            self._data.time, numbers[q], numbers[qd], numbers[p_WO], numbers[quat_WO], numbers[tau]
        )

    def apply(self, tau: Array, forces: Sequence[AppliedForce] = ()) -> None:
        """See :meth:`Plant.apply`."""
        self._ctrl[:] = tau
        if forces or self._pushed:
            self._push(forces)

    def _push(self, forces: Sequence[AppliedForce]) -> None:
        data, body = self._data, self._object
        wrench = data.xfrc_applied[body]
        wrench[:] = 0.0
        for force_W, p_OA_O in forces:
            wrench[:3] += force_W
            if p_OA_O is not None:
                arm = data.xpos[body] + data.xmat[body].reshape(3, 3) @ p_OA_O - data.xipos[body]
                wrench[3:] += np.cross(arm, force_W)
        self._pushed = bool(forces)

    def step(self) -> None:
        """See :meth:`Plant.step`."""
        t = self._data.time  # MuJoCo resets it when the state has diverged
        self.physics.advance()
        if np.count_nonzero(self._warnings):
            raise DivergedError(t)
        self.log()

    def log(self) -> None:
        """Log the step that has just been made, by :meth:`step` or by dm_control."""
        self._contacts.append(self._data)
        self._motion.append()

    def contacts(self, block: Trace) -> None:
        """See :meth:`Plant.contacts`."""
        self._motion.read(block)
        block.p_WC[:] = np.nan
        block.collisions[:] = self._reader.read(
            self._contacts, block.p_WO, rotations(block.quat_WO), block.p_WC, block.f_W
        )
        self._contacts.clear()
