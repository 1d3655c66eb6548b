"""External forces on the object during a run: pushes and added weight."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.signals import AppliedForce
from fulcrum.sim.world.faults import FaultKind, of_kinds
from fulcrum.sim.world.world import World


class Pushes:
    """Forces that the surroundings apply to the object, by time."""

    def __init__(self, world: World) -> None:
        self._pushes = [
            (
                push.t,
                push.t + push.duration_s,
                AppliedForce(*map(np.array, (push.force_W, push.p_OA_O))),
            )
            for push in world.pushes
        ]
        self._weights = [
            (fault, AppliedForce(np.array([0.0, 0.0, -fault.extra_n]), None))
            for fault in of_kinds(world.faults, FaultKind.WEIGHT)
        ]

    def at(self, t: float) -> list[AppliedForce]:
        """Return the forces during the step that begins at time t [s]."""
        forces = [force for start, end, force in self._pushes if start <= t < end]
        return forces + [force for fault, force in self._weights if fault.active(t)]
