r"""The drives: joint impedance at the physics' rate along the path, and the forces last asked for.

.. math:: \tau = g(q) + \left[ M \ddot q_d + C(q, \dot q_d) \dot q_d \right]
                 + s\,J^T f^* + D \dot q_d
                 + M(q) \left( \omega^2 (q_d - q) + 2 \omega (\dot q_d - \dot q) \right)

with :math:`f^*` the forces of the last setpoint that has arrived, s the share of grip that the
schedule asks for and D the joints' viscous friction; what is in brackets only where the control
counts with inertia. The mass matrix M gives every joint, light or heavy, the same bandwidth
:math:`\omega`: damping that is explicit in time stays stable on light wrists. A joint whose encoder
is dead has no impedance. Whatever comes in, what goes out is finite and within the limits.

A stiff impedance would also oppose the squeeze, by which the hands sink into what they hold. So
that the force there is the one asked for, it leaves the squeeze to the feed-forward
(:mod:`sim.control.squeeze`).
"""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np

from fulcrum.sim.control.reaction import GripReaction
from fulcrum.sim.control.squeeze import free_squeeze
from fulcrum.sim.model import RobotModel, RobotState
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.sim.signals import Measurement, Setpoint, Target
from fulcrum.synthesis.arrays import Array, Mask, N


class Drives:
    """Turns measured joint states into torques within the limits.

    Attributes:
        tau_g: Torques that hold the robot up, and where inertia counts also make its motion, as of
            the last update of the model (l,).
        tau: Torques that were last asked for, within the limits (l,).
        saturated: Which of them were cut at their limit, (l,).
        tau_pull: Torques with which the impedance last pulled the joints to their path (l,).
        w_held: Wrenches on the object that the last torques were to make [N, N·m], (m, 6).
    """

    def __init__(self, scenario: Scenario, control: Control, robot: RobotModel) -> None:
        """Take over the belief."""
        self._robot, self._control = robot, control
        joints = len(robot.joints)
        self.tau_g, self.tau_pull, self.tau = np.zeros((3, joints))
        self.saturated = np.zeros(joints, bool)
        contacts, hands = len(scenario.contact_names), len(scenario.hands)
        none = np.zeros(joints), np.zeros((contacts, 6)), np.zeros((hands, 6, joints))
        self._setpoint = Setpoint(*none)
        self._share, self._tau_held, self.w_held = (
            math.nan,
            self.tau_g,
            self._setpoint.w_commanded_C,
        )
        # Deviations of angles and speeds, and torques per each of them: both terms in one product.
        self._deviations, self._gains = np.zeros(2 * joints), np.zeros((joints, 2 * joints))
        self._q_off, self._qd_off = self._deviations[:joints], self._deviations[joints:]
        self._reaction, self._extra = GripReaction(scenario, control, robot), 0.0
        self._update_s = control.solve_every * scenario.physics.timestep
        # Setpoints by path time, in the order of both.
        self._times: list[float] = []
        self._memory: list[Setpoint] = []

    def update_model(self, robot: RobotState, target: Target | None = None) -> None:
        """Take over a state of the robots, for gravity and gains until the next update.

        Args:
            robot: The state.
            target: Whose motion is to be made, inertia and all; None where it does not count.
        """
        omega, mass_matrix = self._control.bandwidth, robot.mass_matrix()
        share, pull, dt = self._share, self.tau_pull, self._update_s
        self._extra = self._reaction.update(
            mass_matrix, self._setpoint, pull, self.tau_g, share, dt
        )
        stiffness, damping = self._reaction.braced(mass_matrix, omega)
        # After bracing, which would scale what is left of the squeeze.
        if self._control.yielding_squeeze and share != 0.0:
            stiffness, damping = free_squeeze(mass_matrix, self._setpoint, stiffness, damping)
        joints = len(stiffness)
        self._gains[:, :joints], self._gains[:, joints:] = stiffness, damping
        self.tau_g = robot.tau_g
        if target is not None and target.qdd is not None:
            self.tau_g = self.tau_g + robot.motion_torques(target.qd, target.qdd)
        self._share = math.nan  # what was held is to be found anew

    def follow(self, setpoint: Setpoint) -> None:
        """Takes over a setpoint that has arrived."""
        self._setpoint = setpoint
        self._share = math.nan

    def remember(self, path_t: float) -> None:
        """Keeps the present setpoint as that of a path time [s] after all that are kept."""
        self._times.append(path_t)
        self._memory.append(self._setpoint)

    def recall(self, path_t: float) -> None:
        """Takes over the setpoint that held at a path time [s], if any is kept."""
        if self._memory:
            setpoint = self._memory[max(0, bisect_right(self._times, path_t) - 1)]
            if setpoint is not self._setpoint:
                self.follow(setpoint)

    def torques(
        self, measurement: Measurement, target: Target, share: float, dead: Mask | None = None
    ) -> tuple[Array, Mask]:
        """Torques [N·m or N], (l,), and which of them were cut at their limit.

        Args:
            measurement: The present state of the joints.
            target: Where they should be.
            share: Of the setpoint's forces that is applied [-].
            dead: Joints without impedance, (l,); None if there are none.
        """
        np.subtract(target.q, measurement.q, self._q_off)
        np.subtract(target.qd, measurement.qd, self._qd_off)
        if dead is not None:
            self._q_off[dead] = self._qd_off[dead] = 0.0
        pull = self._gains.dot(self._deviations)
        if dead is not None:
            pull[dead] = 0.0
        self.tau_pull = pull
        if share != self._share:
            self._hold(share)
        robot = self._robot
        tau = pull + robot.damping * target.qd
        tau += self._tau_held
        if math.isnan(tau.dot(tau)):  # a limit cuts infinities, but lets NaN pass
            tau = np.where(np.isnan(tau), self.tau, tau)
        self.tau = np.minimum(np.maximum(tau, robot.tau_min), robot.tau_max)
        self.saturated = self.tau != tau
        return self.tau, self.saturated

    def _hold(self, share: float) -> None:
        """Finds what holds robot and object until the next setpoint or change of share."""
        self._share = share
        self._tau_held = self.tau_g + share * self._setpoint.tau_f
        self.w_held = share * self._setpoint.w_commanded_C
        if self._extra > 0.0:
            squeeze = share * self._extra * self._reaction.direction
            self._tau_held += squeeze @ self._setpoint.J_C[:, N]
            self.w_held[: len(squeeze), N] += squeeze
