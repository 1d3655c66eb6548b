r"""The drives: joint impedance along the path at the physics rate, plus the forces of the setpoint.

.. math:: \tau = g(q) + \left[ M \ddot q_d + C(q, \dot q_d) \dot q_d \right]
                 + s\,J^T f^* + D \dot q_d
                 + M(q) \left( \omega^2 (q_d - q) + 2 \omega (\dot q_d - \dot q) \right)

with :math:`f^*` the forces of the last setpoint that has arrived, s the share of grip that the
schedule asks for and D the joints' viscous friction. The terms in brackets are used only if the
control includes inertia. The mass matrix M gives every joint, light or heavy, the same bandwidth
:math:`\omega`, so that damping explicit in time stays stable on light wrists. A joint with a dead
encoder has no impedance. The torques are finite and within the limits for any input.

A stiff impedance would also oppose the squeeze, by which the hands sink into the object. The
impedance therefore leaves the squeeze to the feed-forward (:mod:`sim.control.squeeze`), so that the
squeeze has the commanded force.
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
    """The drives of all joints: torques within the limits from measured joint states.

    Attributes:
        tau_g: Torques that carry the robot's weight, at the last update of the model [N·m or N],
            (l,); with inertia, also those that accelerate it.
        tau: Torques last commanded, within the limits [N·m or N], (l,).
        saturated: Which torques were cut at their limit, (l,).
        tau_pull: Torques of the impedance in the last step [N·m or N], (l,).
        w_held: Wrenches on the object commanded by the last torques [N, N·m], (m, 6).
    """

    def __init__(self, scenario: Scenario, control: Control, robot: RobotModel) -> None:
        """Start without contact forces.

        Args:
            scenario: Scenario as the controller believes it to be.
            control: Settings of the controller.
            robot: Model of the robots.
        """
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
        # Deviations of angles and speeds, and their gains: one product gives both torque terms.
        self._deviations, self._gains = np.zeros(2 * joints), np.zeros((joints, 2 * joints))
        self._q_off, self._qd_off = self._deviations[:joints], self._deviations[joints:]
        self._reaction, self._extra = GripReaction(scenario, control, robot), 0.0
        self._update_s = control.solve_every * scenario.physics.timestep
        # Setpoints and their path times, both in ascending order of path time.
        self._times: list[float] = []
        self._memory: list[Setpoint] = []

    def update_model(self, robot: RobotState, target: Target | None = None) -> None:
        """Set gravity torques and gains from a state of the robots, until the next update.

        Args:
            robot: State of the robots.
            target: Motion whose inertial torques are added; None to leave them out.
        """
        omega, mass_matrix = self._control.bandwidth, robot.mass_matrix()
        share, pull, dt = self._share, self.tau_pull, self._update_s
        self._extra = self._reaction.update(
            mass_matrix, self._setpoint, pull, self.tau_g, share, dt
        )
        stiffness, damping = self._reaction.braced(mass_matrix, omega)
        # After bracing, which would scale the remainder of the squeeze.
        if self._control.yielding_squeeze and share != 0.0:
            stiffness, damping = free_squeeze(mass_matrix, self._setpoint, stiffness, damping)
        joints = len(stiffness)
        self._gains[:, :joints], self._gains[:, joints:] = stiffness, damping
        self.tau_g = robot.tau_g
        if target is not None and target.qdd is not None:
            self.tau_g = self.tau_g + robot.motion_torques(target.qd, target.qdd)
        self._share = math.nan  # forces the held torques to be computed again

    def follow(self, setpoint: Setpoint) -> None:
        """Follow a setpoint that has arrived."""
        self._setpoint = setpoint
        self._share = math.nan

    def remember(self, path_t: float) -> None:
        """Store the present setpoint for a path time [s], later than those of all stored ones."""
        self._times.append(path_t)
        self._memory.append(self._setpoint)

    def recall(self, path_t: float) -> None:
        """Follow the stored setpoint that was valid at a path time [s], if any is stored."""
        if self._memory:
            setpoint = self._memory[max(0, bisect_right(self._times, path_t) - 1)]
            if setpoint is not self._setpoint:
                self.follow(setpoint)

    def torques(
        self, measurement: Measurement, target: Target, share: float, dead: Mask | None = None
    ) -> tuple[Array, Mask]:
        """Return torques [N·m or N], (l,), and which of them were cut at their limit, (l,).

        Args:
            measurement: Present state of the joints.
            target: Reference of the joints.
            share: Share of the setpoint's forces that is applied [-].
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
        if math.isnan(tau.dot(tau)):  # clipping removes infinities, but not NaN
            tau = np.where(np.isnan(tau), self.tau, tau)
        self.tau = np.minimum(np.maximum(tau, robot.tau_min), robot.tau_max)
        self.saturated = self.tau != tau
        return self.tau, self.saturated

    def _hold(self, share: float) -> None:
        """Compute the torques that hold robot and object until setpoint or share change."""
        self._share = share
        self._tau_held = self.tau_g + share * self._setpoint.tau_f
        self.w_held = share * self._setpoint.w_commanded_C
        if self._extra > 0.0:
            squeeze = share * self._extra * self._reaction.direction
            self._tau_held += squeeze @ self._setpoint.J_C[:, N]
            self.w_held[: len(squeeze), N] += squeeze
