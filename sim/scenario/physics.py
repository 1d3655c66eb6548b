"""Settings of the contact solver, and the tolerances that define success."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from fulcrum.synthesis.settings import Key, Positive, Settings, Unlimited

# Bounds keep the number of recorded steps of a run finite.
TimeStep = Annotated[float, Ge(1e-5), Le(1.0), Key("timestep_s")]
# Bounded so that a step ends in reasonable time.
Iterations = Annotated[int, Ge(0), Le(10_000)]


@dataclass(frozen=True)
class Physics(Settings):
    """Settings of the contact solver; outcome and forces do not depend on the defaults."""

    timestep: TimeStep = 0.001
    """Time step [s]."""

    # Compliance of friction rows is proportional to its inverse. With and without noslip, the force
    # of an edge of a shipped scene differs by 2.6 % of its peak (RMS) at 100, and by 0.1 % at 1e4.
    impratio: Positive = 1e4
    """Ratio of frictional to normal constraint impedance [-]."""

    noslip_iterations: Iterations = 10
    """Iterations of the noslip post-processing."""


# An infinite limit means that the quantity is not judged.
Limit = Annotated[float, Gt(0), Unlimited]
LimitOrZero = Annotated[float, Ge(0), Unlimited]


@dataclass(frozen=True)
class Judged(Settings):
    """Limits that a run is judged by; inf or false means that a quantity is not judged."""

    final_deg: Limit = 0.1
    """Deviation of the final tilt [deg]."""

    final_mm: Limit = 1.0
    """Distance of the object from the end of its path [mm]: root mean square over its mass, so
    turns about any axis count, too."""

    error_deg: Limit = 0.2
    """Tilt error at any time [deg]."""

    slip_mm: Limit = 0.2
    """Drift of contact points [mm]. Below 0.1 mm it is numerical: at steps of 1 ms, sticking
    contacts creep by up to 0.1 mm in MuJoCo and in Drake, and by half at half the step."""

    support_slip_mm: Limit | None = None
    """Drift of supports [mm]; slip_mm if left out."""

    slide_mm: Limit | None = None
    """Total sliding distance of a contact [mm]; slip_mm if left out."""

    spin_deg: Limit = 0.1
    """Turn of a contact about its normal [deg]."""

    utilisation: Limit = 0.95
    """Friction utilisation in the plant [-]. Supports that hold the same point are not judged,
    since statics does not determine how they share the load."""

    force_error: Limit = 0.03
    """RMS of a hand's measured minus commanded normal force, over its peak commanded force [-]."""

    support_force_error: Limit = 0.05
    """The same for a support [-]. Supports that hold the same point are judged by their sum."""

    saturated_s: LimitOrZero = 0.0
    """Longest uninterrupted time that a torque may be cut at its limit [s]."""

    lost_s: LimitOrZero = 0.005
    """Longest uninterrupted time that a contact may be open [s]; gaps are always reported."""

    support_lost_s: LimitOrZero | None = None
    """The same for supports [s]; lost_s if left out."""

    impact: Limit = 1.0
    """Normal force of an approaching or withdrawing hand, over its largest grip [-]."""

    collisions: bool = True
    """Whether unwanted contacts are failures."""

    no_forces: bool = True
    """Whether a synthesis without solution is a failure."""

    given_up: bool = True
    """Whether lowering or stopping by the guard is a failure."""


@dataclass(frozen=True)
class Disturbed(Judged):
    """Limits for a run in a drawn world: the result, and the loads on hands and motors."""

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
    """Limits that define success; inf or false means that a quantity is not judged."""

    disturbed: Disturbed = Disturbed()
    """Limits for runs with --preset or --world, and for sweeps."""
