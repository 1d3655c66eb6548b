"""Phases of a manoeuvre: tilt, gap and grip at the end of each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Gt, Le

from fulcrum.sim.scenario.timing import Timing
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.settings import Key, NotNegative, Settings, Share, Text

# Bounded by memory: a trace takes about 2 kB per step, a gigabyte in ten minutes.
Duration = Annotated[float, Gt(0), Le(600.0)]
# No arm reaches farther; the joint path has a step every 5 mm.
Gap = Annotated[NotNegative, Le(10.0)]


@dataclass(frozen=True)
class Phase(Settings):
    """A part of the manoeuvre, given by tilt, gap and grip at its end."""

    name: Text
    """Name of the phase."""

    duration_s: Duration
    """Duration [s]."""

    tilt: Share
    """Share of the path at the end [-]."""

    gap: Annotated[Gap, Key("gap_m")]
    """Distance of the tips from their contacts, along the outward normals, at the end [m]."""

    grip: Share
    """Share of the synthesised forces that is applied at the end [-]."""

    timing: Annotated[Timing | None, Key(None)] = None
    """Timing of the progress, of the same duration; None for minimum jerk."""

    @property
    def label(self) -> str:
        """Name of the phase in error messages."""
        return f"phase {self.name}"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gap > 0.0 and self.grip > 0.0:
            raise InvalidInputError(f"{self.label}.grip", self.grip, "0 while there is a gap")
        if self.timing is not None and not math.isclose(self.duration_s, self.timing.duration):
            valid = f"its timing's {self.timing.duration:g} s"
            raise InvalidInputError(f"{self.label}.duration_s", self.duration_s, valid)


STANDOFF = 0.06  # [m] of the hands from the object before and after they hold it


# Approach fast, touch slowly. What follows the tilt depends on whether the object can stand.
REACH = (
    Phase("approach", 1.5, tilt=0.0, gap=0.005, grip=0.0),
    Phase("touch", 0.8, tilt=0.0, gap=0.0, grip=0.0),
    Phase("grip", 1.0, tilt=0.0, gap=0.0, grip=1.0),
)


TILT = (Phase("tilt", 8.0, tilt=1.0, gap=0.0, grip=1.0),)


HOLD = (Phase("hold", 0.5, tilt=1.0, gap=0.0, grip=1.0),)


LEAVE = (
    Phase("set down", 0.5, tilt=1.0, gap=0.0, grip=1.0),
    Phase("let go", 1.0, tilt=1.0, gap=0.0, grip=0.0),
    Phase("withdraw", 1.5, tilt=1.0, gap=STANDOFF, grip=0.0),
    Phase("stand", 1.0, tilt=1.0, gap=STANDOFF, grip=0.0),
)


def tilting(phases: tuple[Phase, ...]) -> tuple[int, ...]:
    """Return the indices of the phases that tilt the object."""
    before = (0.0, *(phase.tilt for phase in phases))
    return tuple(i for i, phase in enumerate(phases) if phase.tilt != before[i])


def stretched(phases: tuple[Phase, ...], duration_s: float) -> tuple[Phase, ...]:
    """Return the phases, with the given duration [s] for each one that tilts the object."""
    turns = tilting(phases)
    return tuple(
        replace(phase, duration_s=duration_s, timing=None) if i in turns else phase
        for i, phase in enumerate(phases)
    )
