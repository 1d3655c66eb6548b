"""The contact solver's settings, and what counts as success."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import length, positive, whole

# A run's steps are to be counted, and kept [s].
_SHORTEST_STEP_S = 1e-5


# Iterations of a solver per step that a run can wait for.
_MOST_ITERATIONS = 10_000


@dataclass(frozen=True)
class Physics:
    """Settings of the contact solver; the defaults keep creep under 0.001 µm/s (see README).

    Attributes:
        timestep: [s].
        impratio: Frictional to normal constraint impedance.
        noslip_iterations: Iterations of the noslip post-processing.
        solref: Contact time constant [s] and damping ratio.
        solimp: Contact impedance d0, dmax, width [m].
        solref_friction: The same for the friction directions.
    """

    timestep: float = 0.001
    impratio: float = 100.0
    noslip_iterations: int = 10
    solref: tuple[float, float] = (0.01, 1.0)
    solimp: tuple[float, float, float] = (0.99, 0.99, 0.001)
    solref_friction: tuple[float, float] = (0.002, 1.0)

    def __post_init__(self) -> None:
        positive("physics.timestep", self.timestep)
        if not _SHORTEST_STEP_S <= self.timestep <= 1.0:
            valid = f"in [{_SHORTEST_STEP_S:g}, 1] s"
            raise InvalidInputError("physics.timestep", self.timestep, valid)
        positive("physics.impratio", self.impratio)
        whole("physics.noslip_iterations", self.noslip_iterations, least=0)
        if self.noslip_iterations > _MOST_ITERATIONS:
            valid = f"at most {_MOST_ITERATIONS}"
            raise InvalidInputError("physics.noslip_iterations", self.noslip_iterations, valid)
        length("physics.solimp", self.solimp, 3)
        for name in ("solref", "solref_friction"):
            length(f"physics.{name}", getattr(self, name), 2)
            for value in getattr(self, name):
                positive(f"physics.{name}", value)
        d0, dmax, width = self.solimp
        if not 0.0 < d0 <= dmax < 1.0:
            raise InvalidInputError("physics.solimp", self.solimp, "0 < d0 <= dmax < 1")
        positive("physics.solimp", width)


@dataclass(frozen=True)
class Tolerances:
    """What counts as success. Infinity, or False, means that something is not judged.

    Attributes:
        final_deg: Deviation of the final tilt [deg].
        error_deg: Tilt error at any time [deg].
        slip_mm: Drift of the material points that touch [mm]; hands may never let go.
        support_slip_mm: The same of supports [mm]; as slip_mm if None.
        slide_mm: Integral of the tangential speed at a contact [mm]; as slip_mm if None.
        spin_deg: Turn about the contact normal [deg].
        utilisation: Friction utilisation in the plant [-]; not of supports that hold the same
            point, which share it as they happen to.
        force_error: RMS of measured minus commanded normal force over the peak commanded one [-];
            of supports that hold the same point that of their force together.
        saturated_s: How long a torque may be cut at its limit at a stretch [s].
        support_lost_s: How long a support may lose touch at a stretch [s].
        impact: Normal force of a hand while no grip is asked for, over its largest grip [-].
        collisions: Whether contacts that the scenario does not want are failures: of geoms that
            must keep clear, and of hands with an object that is to stand alone.
        no_forces: Whether a synthesis that finds no forces is a failure.
        given_up: Whether it is a failure that the guard lowers the object, or stops the run.
    """

    final_deg: float = 0.1
    error_deg: float = 0.2
    slip_mm: float = 0.1
    support_slip_mm: float | None = None
    slide_mm: float | None = None
    spin_deg: float = 0.1
    utilisation: float = 0.95
    force_error: float = 0.02
    saturated_s: float = 0.0
    support_lost_s: float = 0.0
    impact: float = 1.0
    collisions: bool = True
    no_forces: bool = True
    given_up: bool = True

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None or isinstance(value, bool):
                continue
            check = _not_below if field.name.endswith("_s") else _above
            check(f"tolerances.{field.name}", value)


def _above(field: str, value: float) -> None:
    if not value > 0.0:
        raise InvalidInputError(field, value, "a number > 0; inf if it is not to be judged")


def _not_below(field: str, value: float) -> None:
    if not value >= 0.0:
        raise InvalidInputError(field, value, "a number >= 0; inf if it is not to be judged")


# A disturbed run is judged by what it achieves, and by what its hands and motors bear on the way.
DISTURBED = Tolerances(
    final_deg=2.0,
    error_deg=math.inf,
    slip_mm=5.0,
    support_slip_mm=3.0,
    slide_mm=math.inf,
    spin_deg=math.inf,
    utilisation=math.inf,
    force_error=math.inf,
    saturated_s=0.05,
    support_lost_s=math.inf,
    impact=math.inf,
    collisions=False,
    no_forces=False,
    given_up=False,
)
