"""The contact solver's settings, and what counts as success."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.settings import Key, NotNegative, Positive, Settings

# A run's steps are to be counted, and kept.
TimeStep = Annotated[float, Ge(1e-5), Le(1.0), Key("timestep_s")]
# As many iterations per step as a run can wait for.
Iterations = Annotated[int, Ge(0), Le(10_000)]
TimeAndDamping = tuple[Positive, Positive]


@dataclass(frozen=True)
class Physics(Settings):
    """Settings of the contact solver; the defaults keep creep under 0.001 µm/s."""

    timestep: TimeStep = 0.001
    """Time step [s]."""

    impratio: Positive = 100.0
    """Frictional to normal constraint impedance [-]."""

    noslip_iterations: Iterations = 10
    """Iterations of the noslip post-processing."""

    solref: TimeAndDamping = (0.01, 1.0)
    """Contact time constant [s] and damping ratio [-]."""

    solimp: tuple[Positive, Positive, Positive] = (0.99, 0.99, 0.001)
    """Contact impedance d0 and dmax [-], and width [m]."""

    solref_friction: TimeAndDamping = (0.002, 1.0)
    """Time constant [s] and damping ratio [-] of the friction directions."""

    def __post_init__(self) -> None:
        d0, dmax = self.solimp[:2]
        if not 0.0 < d0 <= dmax < 1.0:
            raise InvalidInputError("physics.solimp", self.solimp, "0 < d0 <= dmax < 1")
        super().__post_init__()


@dataclass(frozen=True)
class Tolerances(Settings):
    """What counts as success."""

    final_deg: Positive = 0.1
    """Deviation of the final tilt [deg]."""

    error_deg: Positive = 0.2
    """Tilt error at any time [deg]."""

    slip_mm: Positive = 0.1
    """Drift of the touching points, and how far they slide [mm]."""

    spin_deg: Positive = 0.1
    """Turn about the contact normal [deg]."""

    utilisation: Positive = 0.95
    """Friction utilisation in the plant [-]; not of supports that hold the same point, which share
    it as they happen to."""

    force_error: Positive = 0.02
    """RMS of measured minus commanded normal force, over the peak commanded one [-]; of supports
    that hold the same point that of their force together."""

    saturated_s: NotNegative = 0.0
    """How long a torque may be cut at its limit at a stretch [s]."""
