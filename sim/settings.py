"""How a scenario is run: timing, control, physics, and what counts as success."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from synthesis import InvalidInputError, Objective

# A trace takes about 2 kB per step: a gigabyte in this time [s].
_LONGEST_S = 600.0


@dataclass(frozen=True)
class Timing:
    """Durations of the phases [s]: build up grip, tilt along a minimum-jerk profile, hold."""

    grip_s: float = 1.0
    tilt_s: float = 8.0
    hold_s: float = 0.5

    def __post_init__(self) -> None:
        for name in ("grip_s", "tilt_s", "hold_s"):
            value = getattr(self, name)
            if not 0.0 < value <= _LONGEST_S:
                raise InvalidInputError(
                    f"timing.{name}", value, f"a duration > 0 s and <= {_LONGEST_S:g} s"
                )

    @property
    def total_s(self) -> float:
        """Duration of the whole run [s]."""
        return self.grip_s + self.tilt_s + self.hold_s


@dataclass(frozen=True)
class Control:
    """How forces are synthesised and followed.

    Attributes:
        friction_factor: Share of the believed friction that the synthesis may use [-]; 1 puts the
            optimum on the cone, where it slips.
        preload: Lower bound of the hands' normal forces [N].
        objective: What the synthesis minimises.
        feedforward: Whether synthesised torques are applied at all.
        solve_every: Physics steps per synthesis.
        bandwidth: Natural frequency of the joint impedance, which is critically damped [rad/s].
    """

    friction_factor: float = 0.8
    preload: float = 5.0
    objective: Objective = Objective.MAX_NORMAL_FORCE
    feedforward: bool = True
    solve_every: int = 4
    bandwidth: float = 30.0

    def __post_init__(self) -> None:
        if not 0.0 < self.friction_factor <= 1.0:
            raise InvalidInputError("control.friction_factor", self.friction_factor, "in (0, 1]")
        for name in ("preload", "bandwidth"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InvalidInputError(f"control.{name}", value, "a finite number >= 0")
        if self.solve_every < 1:
            raise InvalidInputError("control.solve_every", self.solve_every, "at least 1 step")


def controllers(control: Control) -> dict[str, Control]:
    """The controllers by name, made from a scenario's own control.

    ``margin`` is that control; ``paper`` is (17) as printed, with the full friction and no preload;
    ``no-feedforward`` applies joint impedance and gravity compensation alone.
    """
    return {
        "margin": control,
        "paper": replace(control, friction_factor=1.0, preload=0.0),
        "no-feedforward": replace(control, feedforward=False),
    }


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


@dataclass(frozen=True)
class Tolerances:
    """What counts as success.

    Attributes:
        final_deg: Deviation of the final tilt [deg].
        error_deg: Tilt error at any time [deg].
        slip_mm: Drift of the touching material points, and the integral of tangential speed [mm].
        spin_deg: Turn about the contact normal [deg].
        utilisation: Friction utilisation in the plant [-].
        force_error: RMS of measured minus commanded normal force over the peak commanded one [-].
    """

    final_deg: float = 0.1
    error_deg: float = 0.2
    slip_mm: float = 0.1
    spin_deg: float = 0.1
    utilisation: float = 0.95
    force_error: float = 0.02
