"""The contact solver's settings, and what counts as success."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.settings import Key, Positive, Settings, Unlimited

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


# None, where it is infinite.
Limit = Annotated[float, Gt(0), Unlimited]
LimitOrZero = Annotated[float, Ge(0), Unlimited]


@dataclass(frozen=True)
class Judged(Settings):
    """What a run is judged by; inf, or false, means that something is not judged."""

    final_deg: Limit = 0.1
    """Deviation of the final tilt [deg]."""

    error_deg: Limit = 0.2
    """Tilt error at any time [deg]."""

    slip_mm: Limit = 0.1
    """Drift of the points that touch [mm]; hands may never let go."""

    support_slip_mm: Limit | None = None
    """The same of supports [mm]; slip_mm, if it is left out."""

    slide_mm: Limit | None = None
    """How far contacts slide in all [mm]; slip_mm, if it is left out."""

    spin_deg: Limit = 0.1
    """Turn about the contact normal [deg]."""

    utilisation: Limit = 0.95
    """Friction utilisation in the plant [-]; not of supports that hold the same point, which share
    it as they happen to."""

    force_error: Limit = 0.02
    """RMS of measured minus commanded normal force, over the peak commanded one [-]; of supports
    that hold the same point that of their force together."""

    saturated_s: LimitOrZero = 0.0
    """How long a torque may be cut at its limit at a stretch [s]."""

    support_lost_s: LimitOrZero = 0.0
    """How long a support may lose touch at a stretch [s]."""

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
    error_deg: Limit = math.inf
    slip_mm: Limit = 5.0
    support_slip_mm: Limit | None = 3.0
    slide_mm: Limit | None = math.inf
    spin_deg: Limit = math.inf
    utilisation: Limit = math.inf
    force_error: Limit = math.inf
    saturated_s: LimitOrZero = 0.05
    support_lost_s: LimitOrZero = math.inf
    impact: Limit = math.inf
    collisions: bool = False
    no_forces: bool = False
    given_up: bool = False


@dataclass(frozen=True)
class Tolerances(Judged):
    """What counts as success; inf, or false, means that something is not judged."""

    disturbed: Disturbed = Disturbed()
    """The same for runs with --preset or --world, and for sweeps."""
