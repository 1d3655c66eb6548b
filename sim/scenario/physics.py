"""The contact solver's settings, and what counts as success."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le

from fulcrum.synthesis.settings import Key, NotNegative, Positive, Settings

# A run's steps are to be counted, and kept.
TimeStep = Annotated[float, Ge(1e-5), Le(1.0), Key("timestep_s")]
# As many iterations per step as a run can wait for.
Iterations = Annotated[int, Ge(0), Le(10_000)]


@dataclass(frozen=True)
class Physics(Settings):
    """Settings of the contact solver; the defaults decide neither how a run ends nor the forces."""

    timestep: TimeStep = 0.001
    """Time step [s]."""

    # Friction rows yield with its inverse. With 100 an edge of a shipped scene carries 2.6 % of its
    # peak (RMS) more or less without noslip than with it, with 1e4 0.1 %.
    impratio: Positive = 1e4
    """Frictional to normal constraint impedance [-]."""

    noslip_iterations: Iterations = 10
    """Iterations of the noslip post-processing."""


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

    force_error: Positive = 0.03
    """RMS of a hand's measured minus commanded normal force, over the peak commanded one [-]."""

    support_force_error: Positive = 0.05
    """The same of a support [-]; of supports that hold the same point that of their force
    together."""

    saturated_s: NotNegative = 0.0
    """How long a torque may be cut at its limit at a stretch [s]."""
