"""When the phases of a manoeuvre are, and what each asks for at any time."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.path import minimum_jerk
from sim.scenario import Scenario
from sim.settings import Phase
from synthesis.contact import Array, Mask


@dataclass(frozen=True)
class Reference:
    """What is asked for at one instant.

    Attributes:
        phase: Index of the phase.
        progress: How much of the phase's motion is done [-], 0 to 1.
        rate: Derivative of the progress [1/s].
        tilt: [rad].
        grip: Share of the synthesised forces [-].
    """

    phase: int
    progress: float
    rate: float
    tilt: float
    grip: float


class Schedule:
    """The phases of a scenario on the time axis.

    Attributes:
        phases: The phases in order.
        starts, ends: When they start and end [s], (p,).
        end: Tilt at the end of the path [rad].
    """

    def __init__(self, scenario: Scenario) -> None:
        self.phases = scenario.phases
        self.end = float(np.radians(scenario.path.angle_deg))
        self.ends = np.cumsum([phase.duration_s for phase in self.phases])
        self.starts = self.ends - [phase.duration_s for phase in self.phases]
        start = Phase("start", 1.0, tilt=0.0, gap=scenario.standoff, grip=0.0)
        self._before = (start, *self.phases[:-1])
        self._ends = self.ends.tolist()

    @property
    def total_s(self) -> float:
        """Duration of the whole manoeuvre [s]."""
        return float(self.ends[-1])

    def before(self, phase: int) -> Phase:
        """The phase before, whose end is this one's start."""
        return self._before[phase]

    def at(self, t: float) -> Reference:
        """What is asked for at time t [s]; after the end, what the last phase ended with."""
        index = min(bisect_right(self._ends, t), len(self.phases) - 1)
        phase, before = self.phases[index], self._before[index]
        progress, rate = minimum_jerk((t - self.starts[index]) / phase.duration_s)
        return Reference(
            phase=index,
            progress=float(progress),
            rate=float(rate) / phase.duration_s,
            tilt=self.end * (before.tilt + (phase.tilt - before.tilt) * float(progress)),
            grip=before.grip + (phase.grip - before.grip) * float(progress),
        )

    def times(self, phase: int, progress: Array) -> Array:
        """When a phase reaches progresses that rise from 0 to 1, counted from its start [s]."""
        x = np.linspace(0.0, 1.0, 10_001)
        return np.interp(progress, minimum_jerk(x)[0], x) * self.phases[phase].duration_s

    @cached_property
    def held(self) -> Mask:
        """Which phases hold the object with full grip: contacts are accountable, (p,)."""
        return self._grips == 2.0

    @cached_property
    def free(self) -> Mask:
        """Which phases ask for no grip at any time, (p,)."""
        return self._grips == 0.0

    @property
    def _grips(self) -> Array:
        """Sum of the grips at start and end of each phase, (p,)."""
        return np.array([b.grip + p.grip for b, p in zip(self._before, self.phases, strict=True)])
