"""The contact solver's settings, and what counts as success."""

from __future__ import annotations

from dataclasses import dataclass, fields

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import length, not_negative, positive, whole

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
    """What counts as success.

    Attributes:
        final_deg: Deviation of the final tilt [deg].
        error_deg: Tilt error at any time [deg].
        slip_mm: Drift of the touching material points, and the integral of tangential speed [mm].
        spin_deg: Turn about the contact normal [deg].
        utilisation: Friction utilisation in the plant [-]; not of supports that hold the same
            point, which share it as they happen to.
        force_error: RMS of measured minus commanded normal force over the peak commanded one [-];
            of supports that hold the same point that of their force together.
        saturated_s: How long a torque may be cut at its limit at a stretch [s].
    """

    final_deg: float = 0.1
    error_deg: float = 0.2
    slip_mm: float = 0.1
    spin_deg: float = 0.1
    utilisation: float = 0.95
    force_error: float = 0.02
    saturated_s: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            check = not_negative if field.name == "saturated_s" else positive
            check(f"tolerances.{field.name}", getattr(self, field.name))
