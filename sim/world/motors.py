"""Errors and faults of the motors: true torques from commanded ones."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.world.faults import Fault, FaultKind, of_kinds
from fulcrum.sim.world.world import World
from fulcrum.synthesis.arrays import Array


class Motors:
    """Errors and faults of the motors: true torques from commanded ones."""

    def __init__(self, world: World, limits: Array, joints: tuple[str, ...]) -> None:
        """Store the motors' true properties.

        Args:
            world: World with the motors' errors and faults.
            limits: Torque limits [N·m or N], (l,).
            joints: Names of the l joints.
        """
        self._gain, self._offset = np.array(world.torque_gain), np.array(world.torque_offset)
        self._noise = world.torque_noise * limits
        self._noisy = world.torque_noise > 0.0
        self._random = np.random.default_rng([world.seed, 3])
        self._joints = joints
        self._faults = of_kinds(world.faults, FaultKind.TORQUE_LOST, FaultKind.TORQUE_STUCK)
        self._stuck: dict[Fault, float] = {}

    def torques(self, t: float, tau: Array) -> Array:
        """Return the joint torques [N·m or N], (l,), at time t [s] before saturation.

        Args:
            t: Time [s].
            tau: Commanded torques [N·m or N], (l,).
        """
        made = self._gain * tau if self._gain.size else tau.copy()
        if self._offset.size:
            made += self._offset
        if self._noisy:
            made += self._noise * self._random.standard_normal(len(tau))
        for fault in self._faults:
            if fault.active(t):
                joint = self._joints.index(fault.joint)
                lost = fault.kind is FaultKind.TORQUE_LOST
                made[joint] = 0.0 if lost else self._stuck.setdefault(fault, float(made[joint]))
        return made
