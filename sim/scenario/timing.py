"""The timing of a phase: constant acceleration between the points of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array


@dataclass(frozen=True)
class Timing:
    r"""Motion of a phase's progress :math:`p` from 0 to 1, with :math:`\dot p^2` linear in p.

    It is linear between grid points, as in :mod:`synthesis.path.problem`. The rate jumps where the
    grid has the same progress twice.

    Attributes:
        progress: Grid of progresses [-], (k,), from 0 to 1, non-decreasing.
        squared_rates: :math:`\dot p^2` at the grid points [1/s^2], (k,).

    Raises:
        InvalidInputError: The arrays describe no motion from 0 to 1.
    """

    progress: tuple[float, ...]
    squared_rates: tuple[float, ...]

    def __post_init__(self) -> None:
        p, b = np.asarray(self.progress, float), np.asarray(self.squared_rates, float)
        if p.ndim != 1 or len(p) < 2 or p.shape != b.shape:
            valid = "as many squared rates as progresses, two at least"
            raise InvalidInputError("timing", f"{p.shape} and {b.shape}", valid)
        if not ((np.diff(p) >= 0.0).all() and p[0] == 0.0 and p[-1] == 1.0):
            raise InvalidInputError(
                "timing.progress", self.progress, "a grid that goes from 0 to 1"
            )
        if not ((b >= 0.0).all() and np.isfinite(b).all()):
            given = self.squared_rates
            raise InvalidInputError("timing.squared_rates", given, "finite numbers >= 0")
        if ((b[1:] + b[:-1] == 0.0) & (np.diff(p) > 0.0)).any():
            raise InvalidInputError("timing.squared_rates", "a rest on the way", "progress")

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self._pieces[0][-1])

    @cached_property
    def _pieces(self) -> tuple[Array, Array, Array, Array]:
        """Times and progresses of the grid, (k,); starting rates and accelerations, (k - 1,)."""
        p, b = np.asarray(self.progress, float), np.asarray(self.squared_rates, float)
        rate, step = np.sqrt(b), np.diff(p)
        moving = step > 0.0
        lasts = np.zeros_like(step)
        lasts[moving] = 2.0 * step[moving] / (rate[:-1] + rate[1:])[moving]
        acceleration = np.zeros_like(step)
        acceleration[moving] = np.diff(b)[moving] / (2.0 * step[moving])
        return np.concatenate([[0.0], np.cumsum(lasts)]), p, rate[:-1], acceleration

    def at(self, elapsed: Array | float) -> tuple[Array, Array, Array]:
        """Return progress, rate [1/s] and acceleration [1/s^2] at times since the start [s].

        Rate and acceleration are zero before the start and after the end.
        """
        times, p, rates, accelerations = self._pieces
        k = np.clip(np.searchsorted(times, elapsed, side="right") - 1, 0, len(rates) - 1)
        since = np.clip(elapsed - times[k], 0.0, times[k + 1] - times[k])
        a, rests = accelerations[k], (elapsed < 0.0) | (elapsed >= times[-1])
        progress = p[k] + since * (rates[k] + 0.5 * a * since)
        rate = np.where(rests, 0.0, rates[k] + a * since)
        return np.clip(progress, 0.0, 1.0), rate, np.where(rests, 0.0, a)

    def times(self, progress: Array | float) -> Array:
        """Return the times since the start [s] at which progresses are first reached."""
        times, p, rates, accelerations = self._pieces
        k = np.clip(np.searchsorted(p, progress, side="left") - 1, 0, len(rates) - 1)
        way = progress - p[k]
        end_rate = np.sqrt(np.maximum(rates[k] ** 2 + 2.0 * accelerations[k] * way, 0.0))
        total = rates[k] + end_rate
        return times[k] + np.divide(2.0 * way, total, out=np.zeros_like(total), where=total > 0.0)
