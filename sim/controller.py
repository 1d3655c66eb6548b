r"""Turns measured states into joint torques: synthesised feed-forward and joint impedance.

.. math:: \tau = g(q) + s\,J^T f^* + D \dot q_d
                 + M(q) \left( \omega^2 (q_d - q) + 2 \omega (\dot q_d - \dot q) \right)

with :math:`f^*` the solution of (17) at the last synthesis, s the share of grip that the schedule
asks for and D the joints' viscous friction. The mass matrix M gives every joint, light or heavy,
the same bandwidth :math:`\omega`: damping that is explicit in time stays stable on light wrists.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from sim.ik import JointPath
from sim.plant import Measurement
from sim.references import References
from sim.robot import RobotModel
from sim.scenario import Scenario
from sim.settings import Control
from sim.statics import Statics
from synthesis import (
    InfeasibleError,
    Problem,
    Solution,
    SolverError,
    Synthesizer,
    UnboundedError,
)
from synthesis.best_effort import BestEffort, best_effort
from synthesis.contact import Array


@dataclass(eq=False, slots=True)  # one every step, and a frozen one takes thrice as long
class Command:
    """What the controller asks of the motors, and why.

    Attributes:
        tau: Torques within the limits [N·m or N], (l,).
        saturated: Which torques were cut at their limit, (l,).
        phase: Index of the phase.
        q_ref: Reference angles [rad or m], (l,).
        tilt_ref: Reference tilt [rad].
        w_OC_C: Commanded wrenches on the object in contact axes [N, N·m], (m, 6).
        synthesis_s: Wall time of this tick's synthesis [s]; 0 where none was due.
        failed: Whether this tick's synthesis had no solution, so that the last forces, or with best
            effort those nearest to balance, are applied.
    """

    tau: Array
    saturated: Array
    phase: int
    q_ref: Array
    tilt_ref: float
    w_OC_C: Array
    synthesis_s: float
    failed: bool


class Controller:
    """Quasi-static force control along the path; holds the last synthesised forces."""

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        robot: RobotModel,
        joint_path: JointPath,
    ) -> None:
        self._control = control
        self._robot = robot
        self._references = References(joint_path, scenario.physics.timestep)
        self._free = joint_path.schedule.free
        self._statics = Statics(scenario, control, robot)
        self._synthesizer = Synthesizer()
        self._tick = 0
        self._w_OC_C = np.zeros((len(scenario.contact_names), 6))
        joints = len(robot.joints)
        self._tau_g, self._tau_f = np.zeros(joints), np.zeros(joints)
        self._share, self._tau_held, self._w_held = math.nan, self._tau_g, self._w_OC_C
        # Deviations of angles and speeds, and torques per each of them: both terms in one product.
        self._deviation, self._gains = np.zeros((2, joints)), np.zeros((joints, 2, joints))

    def command(self, measurement: Measurement) -> Command:
        """The torques for the next step."""
        phase, tilt, grip, q_ref, qd_ref = self._references.at(measurement.t)
        synthesis_s, failed = 0.0, False
        if self._tick % self._control.solve_every == 0:
            self._update_model(measurement)
            self._share = math.nan  # what was held is to be found anew
            if not self._free[phase]:
                started = time.perf_counter()
                failed = not self._synthesize(measurement)
                synthesis_s = time.perf_counter() - started
        self._tick += 1
        share = grip if self._control.feedforward else 0.0
        np.subtract(q_ref, measurement.q, self._deviation[0])
        np.subtract(qd_ref, measurement.qd, self._deviation[1])
        tau = self._gains.reshape(len(q_ref), -1).dot(self._deviation.reshape(-1))
        tau += self._robot.damping * qd_ref
        tau += self._held(share)
        limited = np.minimum(np.maximum(tau, self._robot.tau_min), self._robot.tau_max)
        return Command(
            tau=limited,
            saturated=limited != tau,
            q_ref=q_ref,
            phase=phase,
            tilt_ref=tilt,
            w_OC_C=self._w_held,
            synthesis_s=synthesis_s,
            failed=failed,
        )

    def _held(self, share: float) -> Array:
        """Torques that hold robot and object, as until the next synthesis or change of share."""
        if share != self._share:
            self._share = share
            self._tau_held = self._tau_g + share * self._tau_f
            self._w_held = share * self._w_OC_C
        return self._tau_held

    def _update_model(self, measurement: Measurement) -> None:
        self._robot.update(measurement.q)
        omega, mass_matrix = self._control.bandwidth, self._robot.mass_matrix()
        self._gains[:, 0], self._gains[:, 1] = omega**2 * mass_matrix, 2.0 * omega * mass_matrix
        self._tau_g = self._robot.gravity()

    def _synthesize(self, measurement: Measurement) -> bool:
        """Takes over the forces of a solution, if there is one; returns whether there was."""
        problem = self._statics.problem(measurement.p_WO, measurement.quat_WO)
        forces = self._solve(problem)
        if forces is None:
            return False
        self._w_OC_C = forces.w_OC_C
        self._tau_f = forces.tau - self._tau_g
        return isinstance(forces, Solution)

    def _solve(self, problem: Problem) -> Solution | BestEffort | None:
        try:
            return self._synthesizer.solve(problem)
        except (InfeasibleError, UnboundedError, SolverError):
            if not self._control.best_effort:
                return None
        try:
            return best_effort(problem)
        except (InfeasibleError, SolverError):
            return None
