"""The phases of a manoeuvre over time, and the reference at any time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fulcrum.sim.model import minimum_jerk
from fulcrum.sim.scenario import Phase, Scenario
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Mask


@dataclass(frozen=True)
class Reference:
    """The reference at one instant (numbers) or at many (arrays).

    Attributes:
        phase: Index of the phase.
        progress: Progress of the phase's motion [-], 0 to 1.
        rate, acceleration: First and second derivatives of the progress [1/s, 1/s^2].
        tilt: Tilt [rad].
        turn: Derivative of the tilt by the progress [rad].
        grip: Share of the synthesised forces [-].
    """

    phase: NDArray[np.intp]
    progress: Array
    rate: Array
    acceleration: Array
    tilt: Array
    turn: Array
    grip: Array


class Schedule:
    """The phases of a scenario on the time axis.

    Attributes:
        phases: The phases in order.
        starts, ends: Times at which they start and end [s], (p,).
        end: Tilt at the end of the path [rad].
    """

    def __init__(self, scenario: Scenario) -> None:
        self.phases = scenario.phases
        self.end = float(np.radians(scenario.path.angle_deg))
        self.ends = np.cumsum([phase.duration_s for phase in self.phases])
        self.starts = self.ends - [phase.duration_s for phase in self.phases]
        start = Phase("start", 1.0, tilt=0.0, gap=scenario.standoff, grip=0.0)
        self._before = (start, *self.phases[:-1])
        self._durations = np.array([phase.duration_s for phase in self.phases])
        self._shares_before = np.array([[phase.tilt, phase.grip] for phase in self._before])
        self._changes = [[p.tilt, p.grip] for p in self.phases] - self._shares_before
        timings = [(i, phase.timing) for i, phase in enumerate(self.phases)]
        self._timed = [(i, timing) for i, timing in timings if timing is not None]
        if np.count_nonzero(np.diff(np.concatenate([[0], self.held.astype(int)])) == 1) > 1:
            valid = "at most one stretch with full grip: drift counts from where it began"
            raise InvalidInputError("phases", [p.name for p in self.phases], valid)

    @property
    def total_s(self) -> float:
        """Duration of the whole manoeuvre [s]."""
        return float(self.ends[-1])

    def before(self, phase: int) -> Phase:
        """Return the phase before, whose end is the start of the given one."""
        return self._before[phase]

    def at(self, t: Array | float) -> Reference:
        """Return the reference at times t [s]; after the end, that at the end."""
        index = np.minimum(np.searchsorted(self.ends, t, side="right"), len(self.phases) - 1)
        elapsed, duration = t - self.starts[index], self._durations[index]
        progress, rate, acceleration = minimum_jerk(elapsed / duration)
        rate, acceleration = rate / duration, acceleration / duration**2
        for phase, timing in self._timed:
            own = index == phase
            timed = timing.at(elapsed)
            progress = np.where(own, timed[0], progress)
            rate, acceleration = np.where(own, timed[1:], (rate, acceleration))
        share = self._shares_before[index] + self._changes[index] * np.expand_dims(progress, -1)
        return Reference(
            phase=index,
            progress=progress,
            rate=rate,
            acceleration=acceleration,
            tilt=self.end * share[..., 0],
            turn=self.end * self._changes[index, 0],
            grip=share[..., 1],
        )

    def times(self, phase: int, progress: Array) -> Array:
        """Return the times [s] from a phase's start at progresses that increase from 0 to 1."""
        if (timing := self.phases[phase].timing) is not None:
            return timing.times(progress)
        x = np.linspace(0.0, 1.0, 10_001)
        return np.interp(progress, minimum_jerk(x)[0], x) * self.phases[phase].duration_s

    @cached_property
    def held(self) -> Mask:
        """Mask of the phases with full grip throughout, in which contacts are judged, (p,)."""
        return self._grips == 2.0

    @cached_property
    def free(self) -> Mask:
        """Mask of the phases without grip throughout, (p,)."""
        return self._grips == 0.0

    @property
    def _grips(self) -> Array:
        """Sum of the grips at start and end of each phase, (p,)."""
        return np.array([b.grip + p.grip for b, p in zip(self._before, self.phases, strict=True)])
