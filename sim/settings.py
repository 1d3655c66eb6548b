"""How a scenario is run: timing, control, physics, and what counts as success."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

from sim.checks import each, length, not_negative, positive, whole
from sim.timing import Timing
from synthesis import InvalidInputError, Objective
from synthesis.uncertainty_set import UncertaintySet

# A trace takes about 2 kB per step: a gigabyte in this time [s].
_LONGEST_S = 600.0
# A run's steps are to be counted, and kept [s].
_SHORTEST_STEP_S = 1e-5
# Iterations of a solver per step that a run can wait for.
_MOST_ITERATIONS = 10_000
# No arm reaches farther, and the joint path takes a step every 5 mm [m].
FARTHEST_M = 10.0


@dataclass(frozen=True)
class Phase:
    """A stretch of the manoeuvre: what it brings tilt, hands and grip to.

    Attributes:
        name: What people call it.
        duration_s: [s].
        tilt: Share of the path's angle at the end [-], 0 to 1.
        gap: Distance of the tips from their contacts, along the outward normals, at the end [m].
        grip: Share of the synthesised forces that is applied at the end [-], 0 to 1.
        timing: How it goes there, in that duration; None for minimum jerk.
    """

    name: str
    duration_s: float
    tilt: float
    gap: float
    grip: float
    timing: Timing | None = None

    def __post_init__(self) -> None:
        where = f"phase {self.name}"
        if not 0.0 < self.duration_s <= _LONGEST_S:
            valid = f"a duration > 0 s and <= {_LONGEST_S:g} s"
            raise InvalidInputError(f"{where}.duration_s", self.duration_s, valid)
        for field in ("tilt", "grip"):
            if not 0.0 <= getattr(self, field) <= 1.0:
                raise InvalidInputError(f"{where}.{field}", getattr(self, field), "in [0, 1]")
        if not 0.0 <= self.gap <= FARTHEST_M:
            valid = f"a finite distance >= 0 m and <= {FARTHEST_M:g} m"
            raise InvalidInputError(f"{where}.gap", self.gap, valid)
        if self.gap > 0.0 and self.grip > 0.0:
            raise InvalidInputError(f"{where}.grip", self.grip, "0 while there is a gap")
        if self.timing is not None and not math.isclose(self.duration_s, self.timing.duration):
            valid = f"its timing's {self.timing.duration:g} s"
            raise InvalidInputError(f"{where}.duration_s", self.duration_s, valid)


STANDOFF = 0.06  # [m] of the hands from the object before and after they hold it

# Approach fast and touch slowly; what comes after the tilt depends on whether the object can stand.
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
    """Indices of the phases that tilt the object."""
    before = (0.0, *(phase.tilt for phase in phases))
    return tuple(i for i, phase in enumerate(phases) if phase.tilt != before[i])


def stretched(phases: tuple[Phase, ...], duration_s: float) -> tuple[Phase, ...]:
    """The phases with every one that tilts the object taking the given time [s]."""
    turns = tilting(phases)
    return tuple(
        replace(phase, duration_s=duration_s, timing=None) if i in turns else phase
        for i, phase in enumerate(phases)
    )


@dataclass(frozen=True)
class Robustness:
    """What a grip is to bear.

    Attributes:
        uncertainty: The worlds that it serves, with the true friction.
        preload: Least normal force of the hands [N], against pushes that no grip alone withstands:
            stiff hands and their friction do.
        reaction: By how much harder the hands may press while the impedance holds more than was
            expected [N].
    """

    uncertainty: UncertaintySet
    preload: float
    reaction: float = 0.0

    def __post_init__(self) -> None:
        not_negative("robustness.preload", self.preload)
        not_negative("robustness.reaction", self.reaction)


def _threshold(field: str, value: float) -> None:
    if not value > 0.0:
        raise InvalidInputError(field, value, "a number > 0")


@dataclass(frozen=True)
class Guard:
    """When a run counts as in trouble (see :mod:`sim.guard`); an infinite threshold is none.

    Attributes:
        silence_s: How long the drives go on without a setpoint [s].
        no_forces_s: How long the synthesis may find no forces [s].
        blind_s: How long the object's pose may be missing [s].
        tilt_error_deg: Tilt error, low-pass filtered [deg].
        joint_error: Deviation of a joint from its path [rad or m], if it is also pulled hard.
        joint_pull: Torque with which the impedance pulls it, as a share of its limit [-].
        saturated_s: How long a torque may be cut at its limit while there is grip [s].
        torque_error: Motor's torque against the commanded one, as a share of its limit [-].
        contact_error: Distance of a hand's tip from its contact on the object as seen [m].
        hold_s: How long a hold waits for a cause to pass [s].
        holds_s: How long all holds of a run may take together [s].
        lower_s: How long lowering may be blocked [s].
    """

    silence_s: float = 0.05
    no_forces_s: float = 0.1
    blind_s: float = 0.05
    tilt_error_deg: float = 6.0
    joint_error: float = 0.1
    joint_pull: float = 0.3
    saturated_s: float = 0.05
    torque_error: float = 0.25
    contact_error: float = 0.05
    hold_s: float = 0.5
    holds_s: float = 5.0
    lower_s: float = 2.0

    def __post_init__(self) -> None:
        each("guard", self, _threshold)


@dataclass(frozen=True)
class Control:
    """How forces are synthesised and followed.

    Attributes:
        friction_factor: Share of the believed friction that the synthesis may use [-]; 1 puts the
            optimum on the cone, where it slips.
        preload: Lower bound of the hands' normal forces [N].
        objective: What the synthesis minimises.
        feedforward: Whether synthesised torques are applied at all.
        best_effort: Whether, where no forces balance the object, those nearest to balance are
            applied, instead of the last that did.
        solve_every: Physics steps per synthesis.
        bandwidth: Natural frequency of the joint impedance, which is critically damped [rad/s].
        yielding_squeeze: Whether the impedance leaves the hands' squeeze to the feed-forward.
        robustness: What the grip has to bear beyond the belief; None for the fixed margins of
            ``friction_factor`` and ``preload`` alone.
        inertia: Whether forces and torques also accelerate object and robot as the path's timing
            asks; else both are those of rest.
        pose_filter_s: Time constant with which the object's measured pose is smoothed [s].
        guard: When the run is held, lowered or stopped.
    """

    friction_factor: float = 0.8
    preload: float = 5.0
    objective: Objective = Objective.MAX_NORMAL_FORCE
    feedforward: bool = True
    best_effort: bool = False
    solve_every: int = 4
    bandwidth: float = 30.0
    yielding_squeeze: bool = False
    robustness: Robustness | None = None
    inertia: bool = False
    pose_filter_s: float = 0.0
    guard: Guard = Guard()

    def __post_init__(self) -> None:
        if not 0.0 < self.friction_factor <= 1.0:
            raise InvalidInputError("control.friction_factor", self.friction_factor, "in (0, 1]")
        for name in ("preload", "bandwidth", "pose_filter_s"):
            not_negative(f"control.{name}", getattr(self, name))
        whole("control.solve_every", self.solve_every, least=1)


_ROBUSTNESS = Robustness(
    UncertaintySet(mass=0.2, center=(0.02, 0.02, 0.02), friction=0.2, placement=0.005),
    preload=52.0,
    reaction=45.0,
)


def controllers(control: Control) -> dict[str, Control]:
    """The controllers by name, made from a scenario's own control.

    ``robust`` presses hard enough for every world of an uncertainty set, smooths the measured
    pose and follows the path more stiffly; ``dynamic`` also makes the forces and torques that the
    motion itself takes, for fast tilts; ``margin`` is the scenario's own control; ``paper`` is
    (17) as printed, with the full friction and no preload; ``no-feedforward`` applies joint
    impedance and gravity compensation alone.
    """
    return {
        "robust": replace(
            control,
            robustness=_ROBUSTNESS,
            bandwidth=5.0 * control.bandwidth,
            yielding_squeeze=True,
            pose_filter_s=0.05,
        ),
        "dynamic": replace(
            control,
            inertia=True,
            solve_every=1,
            bandwidth=150.0,
            yielding_squeeze=True,
            pose_filter_s=0.05,
        ),
        "margin": control,
        "paper": replace(control, friction_factor=1.0, preload=0.0),
        "no-feedforward": replace(control, feedforward=False),
    }


def controller(control: Control, name: str, field: str = "controller") -> Control:
    """One of :func:`controllers`.

    Raises:
        InvalidInputError: There is none of that name; names the field that it was given in.
    """
    known = controllers(control)
    if name not in known:
        raise InvalidInputError(field, name, f"one of {', '.join(known)}")
    return known[name]


def default_controller(planned: bool) -> str:
    """The controller that suits: only ``dynamic`` counts with the inertia of a planned tilt."""
    return "dynamic" if planned else "robust"


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
