"""The contact solver's settings, and what counts as success."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from fulcrum.synthesis.settings import Key, Positive, Settings, Unlimited

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


# None, where it is infinite.
Limit = Annotated[float, Gt(0), Unlimited]
LimitOrZero = Annotated[float, Ge(0), Unlimited]


@dataclass(frozen=True)
class Judged(Settings):
    """What a run is judged by; inf, or false, means that something is not judged."""

    final_deg: Limit = 0.1
    """Deviation of the final tilt [deg]."""

    final_mm: Limit = 1.0
    """Distance of the object from where the path puts it, at the end: root mean square over its
    mass, so that it counts turns about any axis, too [mm]."""

    error_deg: Limit = 0.2
    """Tilt error at any time [deg]."""

    slip_mm: Limit = 0.2
    """Drift of the points that touch [mm]. What is below 0.1 mm is numerical: at steps of 1 ms
    contacts that stick creep by up to that in MuJoCo and in Drake, at half the step by half."""

    support_slip_mm: Limit | None = None
    """The same of supports [mm]; slip_mm, if it is left out."""

    slide_mm: Limit | None = None
    """How far contacts slide in all [mm]; slip_mm, if it is left out."""

    spin_deg: Limit = 0.1
    """Turn about the contact normal [deg]."""

    utilisation: Limit = 0.95
    """Friction utilisation in the plant [-]; not of supports that hold the same point, which share
    it as they happen to."""

    force_error: Limit = 0.03
    """RMS of a hand's measured minus commanded normal force, over the peak commanded one [-]."""

    support_force_error: Limit = 0.05
    """The same of a support [-]; of supports that hold the same point that of their force
    together."""

    saturated_s: LimitOrZero = 0.0
    """How long a torque may be cut at its limit at a stretch [s]."""

    lost_s: LimitOrZero = 0.005
    """How long a contact may let go at a stretch [s]; gaps are reported in any case."""

    support_lost_s: LimitOrZero | None = None
    """The same of supports [s]; lost_s, if it is left out."""

    impact: Limit = 1.0
    """Normal force of a hand that comes or goes, over its largest grip [-]."""

    collisions: bool = True
    """Whether contacts that the scenario does not want are failures."""

    no_forces: bool = True
    """Whether it is a failure if the synthesis finds no forces."""

    given_up: bool = True
    """Whether it is a failure if the guard lowers the object or stops the run."""


@dataclass(frozen=True)
class Disturbed(Judged):
    """What a run in a drawn world is judged by: the result, and what hands and motors bear."""

    final_deg: Limit = 2.0
    final_mm: Limit = 10.0
    error_deg: Limit = math.inf
    slip_mm: Limit = 5.0
    support_slip_mm: Limit | None = 3.0
    slide_mm: Limit | None = math.inf
    spin_deg: Limit = math.inf
    utilisation: Limit = math.inf
    force_error: Limit = math.inf
    support_force_error: Limit = math.inf
    saturated_s: LimitOrZero = 0.05
    support_lost_s: LimitOrZero | None = math.inf
    impact: Limit = math.inf
    collisions: bool = False
    no_forces: bool = False
    given_up: bool = False


@dataclass(frozen=True)
class Tolerances(Judged):
    """What counts as success; inf, or false, means that something is not judged."""

    disturbed: Disturbed = Disturbed()
    """The same for runs with --preset or --world, and for sweeps."""
