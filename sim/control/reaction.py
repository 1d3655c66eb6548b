r"""Presses harder, and stiffens, as soon as the impedance holds what the synthesis did not expect.

The impedance's torques :math:`\tau_p` mean contact wrenches of the hands, here by least squares,
weighted like kinetic energy:

.. math:: f_p = (J M^{-1} J^T)^{-1} J M^{-1} \tau_p

With them on top of those of the synthesis each hand needs the normal force that puts it on the
friction cone (2) of the paper; if that is near to what there is, all hands press harder along the
squeeze that moves nothing, the null vector of the normal forces' grasp map, and the arms brace: all
joints become stiffer, and light ones, by which the object would swing about the hands, much more.
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

# Share of the normal force that may be needed before the hands press harder [-].
_NEEDED = 0.78
# Share of the torque limits that pressing harder may use [-].
_TORQUE = 0.88
# How much stiffer joints are that brace; light ones have less than a share of the largest inertia.
_BRACED, _BRACED_LIGHT, _LIGHT = 4.0 / 3.0, 8.0 / 3.0, 0.1
# Less than this is let be [N].
_LEAST = 0.5
# How slowly the hands ease off again [s].
_EASE_S = 0.5
# Singular values below this share of the largest are zero.
_SINGULAR = 1e-6


class GripReaction:
    """How much harder than the setpoint the hands press.

    Attributes:
        direction: Normal forces that add up to nothing, the largest 1, (n,); zeros where the hands
            cannot squeeze.
    """

    def __init__(self, scenario: Scenario, control: Control, robot: RobotModel) -> None:
        self._robot = robot
        self.direction = _squeeze(scenario)
        robustness = control.robustness
        self._most = robustness.reaction if robustness and self.direction.any() else 0.0
        # Per newton of each component, the normal force that the lowest friction needs.
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
        """The normal force to add along the direction [N].

        Args:
            mass_matrix: Of the joints, (l, l).
            setpoint: What the drives make.
            pull: Torques of the impedance [N·m or N], (l,).
            tau_g: Torques that hold the robot up [N·m or N], (l,).
            share: Of the setpoint's forces that is applied [-]; below 1 the hands come or go, and
                what they make is their own affair.
            dt: Time since the last update [s].
        """
        if self._most == 0.0 or not share >= 1.0 or not setpoint.w_commanded_C.any():
            self._extra = 0.0
            return 0.0
        hands = len(self.direction)
        J = setpoint.J_C.reshape(6 * hands, -1)
        weighted = np.linalg.solve(mass_matrix, J.T)
        compliance = J @ weighted
        # Hands that share joints cannot make all wrenches: a trace of damping picks the smallest.
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
        """Stiffness and damping per unit of deviation, (l, l), of joints that brace.

        Args:
            mass_matrix: What the impedance is scaled by, (l, l).
            omega: Bandwidth of joints that don't [rad/s].
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
        """How much the torques, those without the setpoint's given, leave for it [N]."""
        per_newton = self.direction @ setpoint.J_C[:, N]
        tau = tau + share * setpoint.tau_f
        limit = np.where(per_newton > 0.0, self._robot.tau_max, self._robot.tau_min)
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(per_newton == 0.0, np.inf, (_TORQUE * limit - tau) / per_newton)
        return max(0.0, float(room.min()))


def _squeeze(scenario: Scenario) -> Array:
    """Normal forces of the hands whose wrenches cancel, all >= 0, (n,); zeros if there are none."""
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
