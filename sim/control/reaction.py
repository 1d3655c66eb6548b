r"""The reaction of the hands to loads that the synthesis did not expect: more grip, more stiffness.

Such loads show as torques :math:`\tau_p` of the impedance. The contact wrenches of the hands that
belong to them follow by least squares, weighted by the mass matrix as kinetic energy is:

.. math:: f_p = (J M^{-1} J^T)^{-1} J M^{-1} \tau_p

Added to the synthesised wrenches, they give the normal force that each hand needs by the friction
cone (2) of the paper. If that is near to the present normal force, all hands press harder along the
squeeze, which is the null vector of the grasp map of the normal forces and does not move the
object. The arms also brace: all joints become stiffer. Light joints become much stiffer, as the
object could swing about the hands by them.
"""

from __future__ import annotations

import math

import numpy as np

from fulcrum.sim.model import ContactFrames, RobotModel
from fulcrum.sim.model.contacts import contacts
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.sim.signals import Setpoint
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.contact import ContactSet

# Share of the normal force that may be needed for friction before the hands press harder [-].
_NEEDED = 0.78
# Share of the torque limits up to which the hands may press harder [-].
_TORQUE = 0.88
# Factors on the bandwidth of bracing joints and of light ones [-]; light joints have less than the
# last number times the largest inertia [-].
_BRACED, _BRACED_LIGHT, _LIGHT = 4.0 / 3.0, 8.0 / 3.0, 0.1
# Smallest additional normal force that is applied [N].
_LEAST = 0.5
# Time constant with which the additional force decays [s].
_EASE_S = 0.5
# Singular values below this share of the largest are zero.
_SINGULAR = 1e-6


class GripReaction:
    """The normal force that the hands add to the setpoint.

    Attributes:
        direction: Normal forces of the hands that cancel each other, the largest 1 [-], (n,);
            zeros if the hands cannot squeeze.
    """

    def __init__(self, scenario: Scenario, control: Control, robot: RobotModel) -> None:
        self._robot = robot
        self.direction = _squeeze(scenario)
        robustness = control.robustness
        self._most = robustness.reaction if robustness and self.direction.any() else 0.0
        # Normal force needed per unit of each wrench component at the lowest friction.
        lowest = robustness.uncertainty.friction if robustness else 0.0
        hands = ContactSet.of(contacts(scenario, control)).friction[: len(scenario.hands)]
        self._needs = hands * control.friction_factor / (1.0 - lowest) / _NEEDED
        self._extra = 0.0

    def update(
        self,
        mass_matrix: Array,
        setpoint: Setpoint,
        pull: Array,
        tau_g: Array,
        share: float,
        dt: float,
    ) -> float:
        """Return the normal force to add along the direction [N].

        Args:
            mass_matrix: Mass matrix of the joints, (l, l).
            setpoint: Setpoint that the drives follow.
            pull: Torques of the impedance [N·m or N], (l,).
            tau_g: Torques that carry the robot's weight [N·m or N], (l,).
            share: Share of the setpoint's forces that is applied [-]. Below 1 the hands are
                approaching or withdrawing; no reaction is computed.
            dt: Time since the last update [s].
        """
        if self._most == 0.0 or not share >= 1.0 or not setpoint.w_commanded_C.any():
            self._extra = 0.0
            return 0.0
        hands = len(self.direction)
        J = setpoint.J_C.reshape(6 * hands, -1)
        weighted = np.linalg.solve(mass_matrix, J.T)
        compliance = J @ weighted
        # Hands that share joints cannot make all wrenches: slight damping selects the smallest.
        compliance.flat[:: 6 * hands + 1] *= 1.0 + _SINGULAR
        f_p = np.linalg.solve(compliance, weighted.T @ pull).reshape(hands, 6)
        w_C = share * setpoint.w_commanded_C[:hands] + f_p
        need = np.linalg.norm(w_C * self._needs, axis=1) - w_C[:, N]
        wanted = float((need / self.direction).max())
        eased = self._extra * math.exp(-dt / _EASE_S)
        room = self._room(setpoint, tau_g + pull, share)
        extra = min(max(wanted, eased), self._most, room)
        self._extra = extra if extra > _LEAST else 0.0
        return self._extra

    def braced(self, mass_matrix: Array, omega: float) -> tuple[Array, Array]:
        """Return stiffness and damping of the joints, (l, l) each, braced if the hands react.

        Args:
            mass_matrix: Mass matrix that scales the impedance, (l, l).
            omega: Bandwidth of joints that do not brace [rad/s].
        """
        if self._extra == 0.0:
            return omega**2 * mass_matrix, 2.0 * omega * mass_matrix
        inertia = mass_matrix.diagonal()
        light = inertia < _LIGHT * inertia.max()
        bandwidth = omega * np.where(light, _BRACED_LIGHT, _BRACED)
        root = np.sqrt(bandwidth)
        stiffness = bandwidth[:, None] * mass_matrix * bandwidth
        return stiffness, 2.0 * root[:, None] * mass_matrix * root

    def _room(self, setpoint: Setpoint, tau: Array, share: float) -> float:
        """Return the normal force that the torque limits still allow along the direction [N].

        Args:
            setpoint: Setpoint that the drives follow.
            tau: Torques without those of the setpoint [N·m or N], (l,).
            share: Share of the setpoint's forces that is applied [-].
        """
        per_newton = self.direction @ setpoint.J_C[:, N]
        tau = tau + share * setpoint.tau_f
        limit = np.where(per_newton > 0.0, self._robot.tau_max, self._robot.tau_min)
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(per_newton == 0.0, np.inf, (_TORQUE * limit - tau) / per_newton)
        return max(0.0, float(room.min()))


def _squeeze(scenario: Scenario) -> Array:
    """Return positive normal forces of the hands that cancel, (n,); zeros if there are none."""
    frames = ContactFrames(scenario)
    hands = len(scenario.hands)
    normals = frames.in_object(np.eye(3))[:hands, :, N]
    points = frames.p_OC_O[:hands]
    _, sizes, modes = np.linalg.svd(np.vstack([normals.T, np.cross(points, normals).T]))
    mode = modes[-1] / np.abs(modes[-1]).max(initial=1e-300)
    if len(sizes) == hands and sizes[-1] > _SINGULAR * sizes[0]:
        return np.zeros(hands)
    mode = mode * np.sign(mode.sum())
    return mode if (mode > 0.0).all() else np.zeros(hands)
