"""The closed loop: measured state, contact problem, torques, step; until done or stopped."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from dm_control.rl.control import PhysicsError

from fulcrum.sim.control.controller import Controller
from fulcrum.sim.control.replanning import Replanner
from fulcrum.sim.model.contacts import ContactFrames
from fulcrum.sim.model.grip import GripSchedule
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.model.robot import RobotModel
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.joint_path import JointPath
from fulcrum.sim.planning.robust_grip import plan_grip
from fulcrum.sim.plant.engines import Engine, make_plant
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.event import Event
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.signals.trace import Trace
from fulcrum.sim.world.channel import Channel
from fulcrum.sim.world.sensors import Sensors
from fulcrum.sim.world.world import NO_DEVIATION, World
from fulcrum.synthesis import FulcrumError

# Time per block that is handed on while the loop runs [s]; what an abrupt end may lose.
_BLOCK_S = 0.25


class DivergedError(FulcrumError):
    """The simulation's state has left what numbers can hold."""

    def __init__(self, t: float) -> None:
        super().__init__(f"the simulation diverged at {t:.3f} s; check the scenario's physics.")


class ClosedLoop:
    """One run of a scenario.

    Attributes:
        truth: What the plant is.
        robot: The controller's belief about the robot.
        steps: How many steps have been made.
    """

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        truth: Scenario | None = None,
        seed: int = 0,
        joint_path: JointPath | None = None,
        world: World = NO_DEVIATION,
        grip: GripSchedule | None = None,
        replanner: Replanner | None = None,
        engine: Engine = Engine.MUJOCO,
    ) -> None:
        """Plans the joint path, if need be, and sets up plant and controller.

        Args:
            scenario: What the controller believes.
            control: The controller.
            truth: What the plant is but for the world; the scenario if left out.
            seed: Draws the deviations of the start posture.
            joint_path: The scenario's, where it is planned already.
            world: How the plant deviates from that, and what disturbs it; nothing by default.
            grip: What the control's robustness asks for, where it is planned already.
            replanner: Plans the rest of a planned tilt anew where need be.
            engine: What simulates the plant.

        Raises:
            InvalidInputError: The world does not fit the scenario.
            PathError: The arms cannot follow the path.
            RobustInfeasibleError: No grip holds even the nominal object somewhere on the path.
            DivergedError: The start's state is more than numbers can hold.
        """
        self._path = object_path(scenario.path)
        self.robot = robot = RobotModel(scenario)
        joint_path = joint_path or plan_joints(scenario)
        self.truth = world.truth(truth or scenario)
        grip = grip or plan_grip(scenario, control, joint_path)
        self._controller = Controller(
            scenario, control, robot, joint_path, Channel(world), grip, replanner
        )
        self._plant = make_plant(engine, self.truth, world)
        self._sensors = Sensors(world, self._plant.joints)
        deviation = np.random.default_rng(seed).normal(size=len(robot.joints))
        try:
            self._plant.reset(joint_path.start + robot.start_deviation * deviation)
        except PhysicsError as error:
            raise DivergedError(0.0) from error
        self._dt = dt = self.truth.physics.timestep
        self.steps = 0
        self._block = max(1, round(_BLOCK_S / dt))
        self._trace = Trace.allocate(
            self.total_steps, len(robot.joints), len(scenario.hands), len(scenario.contact_names)
        )
        self._p_WC = ContactFrames(scenario).points(*self._path.pose(0.0))

    @property
    def trace(self) -> Trace:
        """The run so far."""
        return self._trace.rows(0, self.steps)

    @property
    def total_steps(self) -> int:
        """How many steps the run takes as things stand."""
        return self.steps + max(0, round(self._controller.left_s(self.steps * self._dt) / self._dt))

    @property
    def events(self) -> tuple[Event, ...]:
        """What went wrong so far, and what was done about it."""
        return self._controller.events

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Pairs of geoms that touched against the scenario's will, and when first [s]."""
        return self._plant.collisions

    def run(self) -> Iterator[Trace]:
        """Steps to the end, handing over each block of rows as soon as it is full.

        Raises:
            DivergedError: The simulation has diverged; the rows before it have been handed over.
        """
        while self.steps < self.total_steps:
            start = self.steps
            stop = min(start + self._block, self.total_steps)
            if stop > len(self._trace):
                self._trace = self._trace.grown(len(self._trace))
            diverged: PhysicsError | None = None
            for row in range(start, stop):
                try:
                    self._step(row, row - start)
                except PhysicsError as error:
                    diverged = error
                    break
                self.steps = row + 1
            block = self._trace.rows(start, self.steps)
            if len(block):
                self._complete(block)
                yield block
            if diverged is not None:
                raise DivergedError(float(self._trace.t[self.steps])) from diverged

    def _complete(self, block: Trace) -> None:
        """Fills the columns that are worked out for a whole block at once."""
        block.tilt[:] = self._path.tilt(block.quat_WO)
        self._plant.read(block)
        # Where there is no contact its last place counts.
        steps, contacts = np.arange(len(block)), np.arange(block.p_WC.shape[1])
        touched = ~np.isnan(block.p_WC[..., 0])
        last = np.maximum.accumulate(np.where(touched, steps[:, None], 0), axis=0)
        block.p_WC[0] = np.where(touched[0, :, None], block.p_WC[0], self._p_WC)
        block.p_WC[:] = block.p_WC[last, contacts]
        self._p_WC = block.p_WC[-1]

    def _step(self, row: int, step: int) -> None:
        trace, plant = self._trace, self._plant
        measurement = plant.measure()
        self._write_state(row, measurement)
        command = self._controller.command(self._sensors.see(measurement))
        plant.apply(command.tau)
        plant.step()
        trace.phase[row], trace.mode[row] = command.phase, command.mode
        trace.q_ref[row], trace.tilt_ref[row] = command.q_ref, command.tilt_ref
        trace.rate_ref[row] = command.rate_ref
        trace.tau[row], trace.saturated[row] = command.tau, command.saturated
        trace.w_command_C[row] = command.w_OC_C
        trace.synthesis_s[row], trace.failed[row] = command.synthesis_s, command.failed
        plant.log(step)

    def _write_state(self, row: int, measurement: Measurement) -> None:
        trace = self._trace
        trace.t[row] = measurement.t
        trace.q[row], trace.qd[row] = measurement.q, measurement.qd
        trace.p_WO[row], trace.quat_WO[row] = measurement.p_WO, measurement.quat_WO
