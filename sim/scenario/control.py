"""How forces are synthesised and followed, and when the guard steps in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Le

from fulcrum.synthesis import InvalidInputError, Objective
from fulcrum.synthesis.robust import UncertaintySet
from fulcrum.synthesis.settings import Inline, Key, NotNegative, OrInfinite, Settings


@dataclass(frozen=True)
class Robustness(Settings):
    """What a grip is to bear."""

    uncertainty: Annotated[UncertaintySet, Inline] = UncertaintySet()
    """The worlds that it serves, with the true friction."""

    preload: Annotated[NotNegative, Key("preload_n")] = 0.0
    """Least normal force of the hands [N], against pushes that no grip alone withstands: stiff
    hands and their friction do."""

    reaction: Annotated[NotNegative, Key("reaction_n")] = 0.0
    """By how much harder the hands may press while the impedance holds more than was expected
    [N]."""


# An infinite threshold is none.
Threshold = Annotated[float, Gt(0), OrInfinite]


@dataclass(frozen=True)
class Guard(Settings):
    """When a run counts as in trouble."""

    silence_s: Threshold = 0.05
    """How long the drives go on without a setpoint [s]."""

    no_forces_s: Threshold = 0.1
    """How long the synthesis may find no forces [s]."""

    blind_s: Threshold = 0.05
    """How long the object's pose may be missing [s]."""

    tilt_error_deg: Threshold = 6.0
    """Tilt error, low-pass filtered [deg]."""

    joint_error: Threshold = 0.1
    """Deviation of a joint from its path [rad or m], if it is also pulled hard."""

    joint_pull: Threshold = 0.3
    """Torque with which the impedance pulls it, as a share of its limit [-]."""

    saturated_s: Threshold = 0.05
    """How long a torque may be cut at its limit while there is grip [s]."""

    torque_error: Threshold = 0.25
    """Motor's torque against the commanded one, as a share of its limit [-]."""

    contact_error: Annotated[Threshold, Key("contact_error_m")] = 0.05
    """Distance of a hand's tip from its contact on the object as seen [m]."""

    hold_s: Threshold = 0.5
    """How long a hold waits for a cause to pass [s]."""

    holds_s: Threshold = 5.0
    """How long all holds of a run may take together [s]."""

    lower_s: Threshold = 2.0
    """How long lowering may be blocked [s]."""


@dataclass(frozen=True)
class Control(Settings):
    """How forces are synthesised and followed by controller margin; the others are made of it."""

    friction_factor: Annotated[float, Gt(0), Le(1.0)] = 0.8
    """Share of the believed friction that the synthesis may use [-]; 1 puts the optimum on the
    cone, where it slips."""

    preload: Annotated[NotNegative, Key("preload_n")] = 5.0
    """Least normal force of the hands [N]."""

    objective: Objective = Objective.MAX_NORMAL_FORCE
    """What the synthesis minimises."""

    feedforward: bool = True
    """Whether synthesised torques are applied at all."""

    solve_every: Annotated[int, Ge(1)] = 4
    """Physics steps per synthesis."""

    bandwidth: Annotated[NotNegative, Key("bandwidth_rad_s")] = 30.0
    """Natural frequency of the joint impedance, which is critically damped [rad/s]."""

    yielding_squeeze: bool = True
    """Whether the impedance leaves the hands' squeeze to the feed-forward; else it holds back hands
    that sink into soft contacts."""

    robustness: Robustness | None = None
    """What the grip has to bear beyond the fixed margins of friction_factor and preload_n;
    controller robust has its own."""

    inertia: bool = False
    """Whether forces and torques also accelerate object and robot as the path's timing asks; else
    both are those of rest."""

    pose_filter_s: NotNegative = 0.0
    """Time constant with which the object's measured pose is smoothed [s]."""

    guard: Guard = Guard()
    """When the run is held, lowered or stopped."""


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
            pose_filter_s=0.05,
        ),
        "dynamic": replace(
            control,
            inertia=True,
            solve_every=1,
            bandwidth=150.0,
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


def comparable(control: Control, planned: bool) -> tuple[str, ...]:
    """Return the controllers with feed-forward that suit: with inertia for a planned tilt."""
    known = controllers(control).items()
    return tuple(name for name, c in known if c.feedforward and c.inertia is planned)
