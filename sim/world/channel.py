"""Transmission from the outer loop to the drives, with latency and losses."""

from __future__ import annotations

from collections import deque

import numpy as np

from fulcrum.sim.signals import Setpoint
from fulcrum.sim.world.faults import FaultKind, of_kinds
from fulcrum.sim.world.world import World


class Channel:
    """A channel that delivers setpoints after the world's latency and loses some of them."""

    def __init__(self, world: World) -> None:
        self._latency, self._dropped = world.latency, world.dropped
        self._random = np.random.default_rng([world.seed, 2])
        self._silences = of_kinds(world.faults, FaultKind.SILENCE)
        self._sent: deque[tuple[float, Setpoint]] = deque()

    def send(self, t: float, setpoint: Setpoint) -> None:
        """Send a setpoint that was computed from the measurement at time t [s]."""
        if self._dropped > 0.0 and self._random.random() < self._dropped:
            return
        self._sent.append((t + self._latency, setpoint))

    def receive(self, t: float) -> Setpoint | None:
        """Return the newest setpoint that has arrived since the last call; None without one."""
        newest = None
        for silence in self._silences:
            if silence.active(t):
                return None
        # Times and latency are sums of steps: half a nanosecond is rounding.
        while self._sent and self._sent[0][0] <= t + 5e-10:
            newest = self._sent.popleft()[1]
        return newest
