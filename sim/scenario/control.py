"""How forces are synthesised and followed, and when the guard steps in."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fulcrum.synthesis import InvalidInputError, Objective
from fulcrum.synthesis.checks import each, not_negative, whole
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet


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
    """When a run counts as in trouble (:mod:`sim.control.guard`); an infinite threshold is none.

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


def comparable(control: Control, planned: bool) -> tuple[str, ...]:
    """Return the controllers with feed-forward that suit: with inertia for a planned tilt."""
    known = controllers(control).items()
    return tuple(name for name, c in known if c.feedforward and c.inertia is planned)
