"""Drake's plant for a loop whose plant makes motors and pushes itself.

It goes when the loop disturbs every plant alike (:mod:`sim.plant.protocol`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_control.rl.control import PhysicsError

from fulcrum.sim.plant.drake import DrakePlant
from fulcrum.sim.plant.protocol import DivergedError
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.force import AppliedForce
from fulcrum.sim.signals.trace import Trace
from fulcrum.sim.world.faults import FaultKind, of_kinds
from fulcrum.sim.world.motors import Motors
from fulcrum.sim.world.world import World
from fulcrum.synthesis.arrays import Array


class DisturbedDrakePlant(DrakePlant):
    """Drake's plant with the world's motors, pushes and weights."""

    def __init__(self, scenario: Scenario, world: World) -> None:
        super().__init__(scenario, world)
        self._world = world
        self._motors = Motors(world, self._limits[1], self.joints)
        self._weights = of_kinds(world.faults, FaultKind.WEIGHT)

    def apply(self, tau: Array, forces: Sequence[AppliedForce] = ()) -> None:
        """Set what the motors make of the torques, and what the world does to the object."""
        t = self._steps * self._dt
        pushes = [
            AppliedForce(np.array(push.force_W), np.array(push.p_OA_O))
            for push in self._world.pushes
            if push.t <= t < push.t + push.duration_s
        ]
        weights = [
            AppliedForce(np.array([0.0, 0.0, -fault.extra_n]), None)
            for fault in self._weights
            if fault.active(t)
        ]
        super().apply(self._motors.torques(t, tau), [*forces, *pushes, *weights])

    def step(self) -> None:
        """Make one physics step, and log it."""
        try:
            super().step()
        except DivergedError as error:
            raise PhysicsError(str(error)) from error

    def log(self, step: int) -> None:
        """Nothing: a step logs itself."""

    def read(self, block: Trace) -> None:
        """Fill a block's columns."""
        self.contacts(block)
