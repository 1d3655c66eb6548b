"""The closed loop: measured state, contact problem, torques, step, until the run ends."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fulcrum.sim.control import Controller
from fulcrum.sim.model import ContactFrames, RobotModel
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.plant import DivergedError, Plant
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Measurement, Trace
from fulcrum.sim.world import Motors, Pushes, Sensors, World
from fulcrum.synthesis.arrays import Array

# Duration of a block of rows [s]; an abrupt end loses at most one block.
_BLOCK_S = 0.25


class ClosedLoop:
    """The closed loop of one run.

    Attributes:
        robot: Model of the robots that the controller uses.
        truth: True scenario, as the plant has it.
        plant: Plant that is controlled.
        controller: Controller of the plant.
        steps: Number of steps made so far.
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: RobotModel,
        truth: Scenario,
        plant: Plant,
        controller: Controller,
        world: World,
        start: Array,
        seed: int = 0,
    ) -> None:
        """Put plant and controller at the start.

        Args:
            scenario: Scenario that the controller assumes.
            robot: Model of the robots that the controller uses.
            truth: True scenario, as the plant has it.
            plant: Plant that is controlled.
            controller: Controller of the plant.
            world: Disturbances of sensors, motors and object.
            start: Joint positions at the start, before small deviations [rad or m], (l,).
            seed: Seed of these deviations and of the controller's random numbers.

        Raises:
            InvalidInputError: The world does not fit the scenario.
            DivergedError: The state at the start is not finite.
        """
        self.robot, self.truth, self.plant, self.controller = robot, truth, plant, controller
        self._path = object_path(scenario.path)
        self._sensors, self._pushes = Sensors(world, plant.joints), Pushes(world)
        self._motors = Motors(world, robot.tau_max, plant.joints)
        deviation = np.random.default_rng(seed).normal(size=len(robot.joints))
        plant.reset(start + robot.start_deviation * deviation)
        controller.reset(scenario, robot, seed)
        self._dt = dt = scenario.physics.timestep
        self.steps = 0
        self._block = max(1, round(_BLOCK_S / dt))
        self._trace = Trace.allocate(
            self.total_steps, len(robot.joints), len(scenario.hands), len(scenario.contact_names)
        )
        self._p_WC = ContactFrames(scenario).points(*self._path.pose(0.0))

    @property
    def trace(self) -> Trace:
        """Trace of the run so far."""
        return self._trace.rows(0, self.steps)

    @property
    def total_steps(self) -> int:
        """Expected number of steps of the run."""
        return self.steps + max(0, round(self.controller.left_s(self.steps * self._dt) / self._dt))

    def run(self) -> Iterator[Trace]:
        """Step to the end, and yield each block of rows as soon as it is full.

        Raises:
            DivergedError: The simulation has diverged; the rows before it have been yielded.
        """
        while self.steps < self.total_steps:
            start = self.steps
            stop = min(start + self._block, self.total_steps)
            if stop > len(self._trace):
                self._trace = self._trace.grown(len(self._trace))
            diverged: DivergedError | None = None
            for row in range(start, stop):
                try:
                    self._step(row)
                except DivergedError as error:
                    diverged = error
                    break
                self.steps = row + 1
            block = self._trace.rows(start, self.steps)
            if len(block):
                self._complete(block)
                yield block
            if diverged is not None:
                raise diverged

    def _complete(self, block: Trace) -> None:
        """Fill the columns that are computed for a whole block at once."""
        block.tilt[:] = self._path.tilt(block.quat_WO)
        self.plant.contacts(block)
        # Where there is no contact, its last place is used.
        steps, contacts = np.arange(len(block)), np.arange(block.p_WC.shape[1])
        touched = ~np.isnan(block.p_WC[..., 0])
        last = np.maximum.accumulate(np.where(touched, steps[:, None], 0), axis=0)
        block.p_WC[0] = np.where(touched[0, :, None], block.p_WC[0], self._p_WC)
        block.p_WC[:] = block.p_WC[last, contacts]
        self._p_WC = block.p_WC[-1]

    def _step(self, row: int) -> None:
        trace, plant = self._trace, self.plant
        truth = plant.measure()
        self._write_state(row, truth)
        command = self.controller.command(self._sensors.see(truth))
        plant.apply(self._motors.torques(truth.t, command.tau), self._pushes.at(truth.t))
        plant.step()
        trace.phase[row], trace.mode[row] = command.phase, command.mode
        trace.q_ref[row], trace.tilt_ref[row] = command.q_ref, command.tilt_ref
        trace.rate_ref[row] = command.rate_ref
        trace.tau[row], trace.saturated[row] = command.tau, command.saturated
        trace.w_commanded_C[row] = command.w_commanded_C
        trace.synthesis_s[row], trace.failed[row] = command.synthesis_s, command.failed

    def _write_state(self, row: int, truth: Measurement) -> None:
        trace = self._trace
        trace.t[row] = truth.t
        trace.q[row], trace.qd[row] = truth.q, truth.qd
        trace.p_WO[row], trace.quat_WO[row] = truth.p_WO, truth.quat_WO
