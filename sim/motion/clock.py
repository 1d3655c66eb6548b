"""Path time: the time on the schedule, which may stand still or run backwards."""

from __future__ import annotations

# Slope of the rate of path time [1/s]: from running to standing in 0.2 s.
_RAMP = 5.0


class PathClock:
    """Path time: the plant's time minus a delay, which changes while the rate is not 1.

    Attributes:
        delay: Plant's time minus path time [s].
        rate: Rate of path time [s/s].
        change: Derivative of the rate [1/s].
    """

    def __init__(self, timestep: float) -> None:
        """Start at the plant's time, with a time between ticks of `timestep` [s]."""
        self._timestep = timestep
        self.delay, self.rate, self.change = 0.0, 1.0, 0.0

    def at(self, t: float, rate: float) -> float:
        """Return the path time at the next tick [s], at least 0.

        Args:
            t: Plant's time [s].
            rate: Target of the clock's rate [s/s], which is approached along a ramp.
        """
        if self.rate != 1.0 or rate != 1.0:
            before, change = self.rate, _RAMP * self._timestep
            self.rate = min(max(rate, before - change), before + change)
            self.change = (self.rate - before) / self._timestep
            self.delay += (1.0 - 0.5 * (before + self.rate)) * self._timestep
            self.delay = min(self.delay, t)
        else:
            self.change = 0.0
        return t - self.delay
