"""Path time: where on the schedule a run is, which may stand still or run backwards."""

from __future__ import annotations

# How fast the rate of path time changes [1/s]: from running to standing in 0.2 s.
_RAMP = 5.0


class PathClock:
    """Path time that follows the plant's time with a delay, which changes while the rate is not 1.

    Attributes:
        delay: Plant's time minus path time [s].
        rate: Seconds of path per second [-].
        change: How fast that changes [1/s].
    """

    def __init__(self, timestep: float) -> None:
        """Starts in step with the plant's time, which ticks in steps [s]."""
        self._timestep = timestep
        self.delay, self.rate, self.change = 0.0, 1.0, 0.0

    def at(self, t: float, rate: float) -> float:
        """Path time at the next tick [s], not before the path's start.

        Args:
            t: The plant's time [s].
            rate: What the clock's rate is to be brought to, along a ramp.
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
