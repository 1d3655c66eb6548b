"""Settings of force synthesis, impedance and guard; the named controllers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Le

from fulcrum.synthesis import InvalidInputError, Objective
from fulcrum.synthesis.robust import UncertaintySet
from fulcrum.synthesis.settings import Inline, Key, NotNegative, OrInfinite, Settings


@dataclass(frozen=True)
class Robustness(Settings):
    """Requirements on the grip: deviations to withstand, preload and reaction."""

    uncertainty: Annotated[UncertaintySet, Inline] = UncertaintySet()
    """Deviations from the scenario with its true friction, all of which the grip withstands."""

    preload: Annotated[NotNegative, Key("preload_n")] = 0.0
    """Least normal force of the hands [N]. It covers pushes that only stiff hands and their
    friction withstand."""

    reaction: Annotated[NotNegative, Key("reaction_n")] = 0.0
    """Largest extra normal force of the hands [N] while the impedance holds more than expected."""


# An infinite threshold is never reached.
Threshold = Annotated[float, Gt(0), OrInfinite]


@dataclass(frozen=True)
class Guard(Settings):
    """Thresholds at which the guard holds, lowers or stops a run."""

    silence_s: Threshold = 0.05
    """Longest time that the drives continue without a setpoint [s]."""

    no_forces_s: Threshold = 0.1
    """Longest time that the synthesis may find no forces [s]."""

    blind_s: Threshold = 0.05
    """Longest time that the object's pose may be missing [s]."""

    tilt_error_deg: Threshold = 6.0
    """Largest tilt error, low-pass filtered [deg]."""

    joint_error: Threshold = 0.1
    """Largest deviation of a joint from its path [rad or m]; counts together with joint_pull."""

    joint_pull: Threshold = 0.3
    """Largest impedance torque at that joint, as a share of its limit [-]."""

    saturated_s: Threshold = 0.05
    """Longest time that a torque may be cut at its limit while there is grip [s]."""

    torque_error: Threshold = 0.25
    """Largest difference of measured and commanded motor torque, as a share of the limit [-]."""

    contact_error: Annotated[Threshold, Key("contact_error_m")] = 0.05
    """Largest distance of a hand's tip from its contact on the measured object [m]."""

    hold_s: Threshold = 0.5
    """Longest time that a hold waits for its cause to pass [s]."""

    holds_s: Threshold = 5.0
    """Longest total time of all holds of a run [s]."""

    lower_s: Threshold = 2.0
    """Longest time that lowering may be blocked [s]."""


@dataclass(frozen=True)
class Control(Settings):
    """Settings of controller margin; the other controllers are derived from it."""

    friction_factor: Annotated[float, Gt(0), Le(1.0)] = 0.8
    """Share of the scenario's friction that the synthesis may use [-]. At 1 the optimum lies on
    the friction cone, where contacts slip."""

    preload: Annotated[NotNegative, Key("preload_n")] = 5.0
    """Least normal force of the hands [N]."""

    objective: Objective = Objective.MAX_NORMAL_FORCE
    """Objective that the synthesis minimises."""

    feedforward: bool = True
    """Whether synthesised torques are applied."""

    solve_every: Annotated[int, Ge(1)] = 4
    """Physics steps per synthesis."""

    bandwidth: Annotated[NotNegative, Key("bandwidth_rad_s")] = 30.0
    """Natural frequency of the joint impedance, which is critically damped [rad/s]."""

    yielding_squeeze: bool = True
    """Whether the impedance leaves the hands' squeeze to the feed-forward. Otherwise it holds back
    hands that sink into soft contacts."""

    robustness: Robustness | None = None
    """What the grip must withstand beyond the margins friction_factor and preload_n; if it is left
    out, controller robust has values of its own (docs, "Robustness and sweeps")."""

    inertia: bool = False
    """Whether forces and torques include the inertia of object and robot on the timed path;
    otherwise they are those at rest."""

    pose_filter_s: NotNegative = 0.0
    """Time constant of the low-pass filter on the object's measured pose [s]."""

    guard: Guard = Guard()
    """Thresholds at which the run is held, lowered or stopped."""


_ROBUSTNESS = Robustness(
    UncertaintySet(mass=0.2, center=(0.02, 0.02, 0.02), friction=0.2, placement=0.005),
    preload=52.0,
    reaction=45.0,
)


def controllers(control: Control) -> dict[str, Control]:
    """Return the controllers by name, derived from a scenario's control.

    - ``robust`` presses hard enough for every world of an uncertainty set, smooths the measured
      pose and follows the path more stiffly.
    - ``dynamic`` adds the forces and torques of the motion itself, for fast tilts.
    - ``margin`` is the scenario's own control.
    - ``paper`` is (17) as printed, with the full friction and no preload.
    - ``no-feedforward`` applies only joint impedance and gravity compensation.
    """
    return {
        "robust": replace(
            control,
            robustness=control.robustness or _ROBUSTNESS,
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
    """Return one of :func:`controllers` by name.

    Raises:
        InvalidInputError: There is none of that name; names the `field`.
    """
    known = controllers(control)
    if name not in known:
        raise InvalidInputError(field, name, f"one of {', '.join(known)}")
    return known[name]


def default_controller(planned: bool) -> str:
    """Return the default controller: ``dynamic`` for a planned tilt, else ``robust``."""
    return "dynamic" if planned else "robust"


def comparable(control: Control, planned: bool) -> tuple[str, ...]:
    """Return the controllers with feed-forward; for a planned tilt, those with inertia."""
    known = controllers(control).items()
    return tuple(name for name, c in known if c.feedforward and c.inertia is planned)
