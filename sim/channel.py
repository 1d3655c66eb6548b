"""The wire from the outer loop to the drives: what is sent arrives late, or not at all."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from sim.faults import FaultKind, of_kinds
from sim.world import World
from synthesis.contact import Array


@dataclass(eq=False, slots=True)
class Setpoint:
    """What the outer loop tells the drives.

    Attributes:
        tau_f: Torques that make the contact forces [N·m or N], (l,).
        w_OC_C: Those forces on the object in contact axes [N, N·m], (m, 6).
        J_C: Jacobians of the hands in contact axes, (n, 6, l).
    """

    tau_f: Array
    w_OC_C: Array
    J_C: Array


class Channel:
    """Delivers setpoints after the world's latency; some get lost."""

    def __init__(self, world: World) -> None:
        self._latency, self._dropped = world.latency, world.dropped
        self._random = np.random.default_rng([world.seed, 2])
        self._silences = of_kinds(world.faults, FaultKind.SILENCE)
        self._sent: deque[tuple[float, Setpoint]] = deque()

    def send(self, t: float, setpoint: Setpoint) -> None:
        """Takes a setpoint that was worked out from the measurement at a time [s]."""
        if self._dropped > 0.0 and self._random.random() < self._dropped:
            return
        self._sent.append((t + self._latency, setpoint))

    def receive(self, t: float) -> Setpoint | None:
        """The newest setpoint that has arrived since last asked; None if there is none."""
        newest = None
        for silence in self._silences:
            if silence.active(t):
                return None
        # Times are sums of steps, and so is the latency: half a nanosecond is rounding.
        while self._sent and self._sent[0][0] <= t + 5e-10:
            newest = self._sent.popleft()[1]
        return newest
