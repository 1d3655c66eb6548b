"""The scenario file as models, second part: timing, control, physics, tolerances, view."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Gt, Le, Len
from pydantic import Field

from fulcrum.scenarios.schema.keys import NotNegative, Number, Positive, Table, Text, Vector3
from fulcrum.sim.scenario.control import Control, Guard
from fulcrum.sim.scenario.phases import REACH, STANDOFF
from fulcrum.sim.scenario.physics import DISTURBED, Physics, Tolerances
from fulcrum.sim.scenario.scenario import View
from fulcrum.synthesis import Objective

APPROACH, TOUCH, GRIP = REACH
Seconds = Annotated[Number, Gt(0.0), Le(600.0)]
Share = Annotated[Number, Field(ge=0.0, le=1.0)]
Fraction = Annotated[Number, Field(ge=0.0, lt=1.0)]
Spread3 = Annotated[list[NotNegative], Len(3, 3)]
# An infinite one is none.
Limit = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=True)]
LimitOrZero = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=True)]
Count = Annotated[int, Field(strict=True, ge=1)]


class PhaseTable(Table):
    """A stretch of the manoeuvre: what it brings tilt, hands and grip to."""

    name: Text
    """What it is called."""

    duration_s: Seconds
    """Duration [s]."""

    tilt: Share
    """Share of the path at the end [-]."""

    gap_m: Annotated[NotNegative, Le(10.0)]
    """Distance of the tips from their contacts at the end [m]."""

    grip: Share
    """Share of the forces that is applied at the end [-]."""


class ManoeuvreTable(Table):
    """Timing of the phases: approach, touch, grip, tilt, and what comes then."""

    approach_s: Seconds = APPROACH.duration_s
    """Duration in which the hands come near [s]."""

    touch_s: Seconds = TOUCH.duration_s
    """Duration of the last 5 mm to their contacts [s]: heavy links touch hard."""

    grip_s: Seconds = GRIP.duration_s
    """Duration in which the grip builds up [s]."""

    tilt_s: Seconds = 8.0
    """Duration of the tilt [s]."""

    after: Literal["leave", "hold"] = "hold"
    """What comes after the tilt: hold holds the object, leave sets it down and withdraws."""

    standoff_m: Annotated[NotNegative, Le(10.0)] = STANDOFF
    """Distance of the hands from their contacts at the start [m]."""

    phases: list[PhaseTable] | None = None
    """All phases one by one, instead of durations and after."""


class RobustnessTable(Table):
    """What a grip is to bear."""

    mass: Fraction = 0.0
    """Share by which the mass may be lower or higher [-]."""

    center_m: Spread3 = [0.0, 0.0, 0.0]
    """Offset of the centre of mass along each of the object's axes, either way [m]."""

    friction: Fraction = 0.0
    """Share by which friction may be lower [-]."""

    push_n: Spread3 = [0.0, 0.0, 0.0]
    """Largest push along each of the object's axes, either way [N]."""

    lever_m: Spread3 = [0.0, 0.0, 0.0]
    """How far from the centre of mass pushes act, along the object's axes [m]."""

    placement_m: NotNegative = 0.0
    """Distance by which hands may miss their contacts [m]."""

    preload_n: NotNegative = 0.0
    """Least normal force of the hands [N]."""

    reaction_n: NotNegative = 0.0
    """By how much harder the hands may press when pushed [N]."""


class GuardTable(Table):
    """When a run counts as in trouble."""

    silence_s: Positive = Guard.silence_s
    """How long the drives go on without a setpoint [s]."""

    no_forces_s: Positive = Guard.no_forces_s
    """How long the synthesis may find no forces [s]."""

    blind_s: Positive = Guard.blind_s
    """How long the object's pose may be missing [s]."""

    tilt_error_deg: Positive = Guard.tilt_error_deg
    """Tilt error, low-pass filtered [deg]."""

    joint_error: Positive = Guard.joint_error
    """Deviation of a joint from its path [rad or m], if it is also pulled hard."""

    joint_pull: Positive = Guard.joint_pull
    """Torque with which it is pulled, as a share of its limit [-]."""

    saturated_s: Positive = Guard.saturated_s
    """How long a torque may be cut at its limit while there is grip [s]."""

    torque_error: Positive = Guard.torque_error
    """Motor's torque against the commanded one, as a share of its limit [-]."""

    contact_error_m: Positive = Guard.contact_error
    """Distance of a hand's tip from its contact on the object as seen [m]."""

    hold_s: Positive = Guard.hold_s
    """How long a hold waits for a cause to pass [s]."""

    holds_s: Positive = Guard.holds_s
    """How long all holds of a run may take together [s]."""

    lower_s: Positive = Guard.lower_s
    """How long lowering may be blocked [s]."""


class ControlTable(Table):
    """How forces are synthesised and followed by controller margin; the others are made of it."""

    friction_factor: Annotated[Positive, Le(1.0)] = Control.friction_factor
    """Share of the friction that the synthesis may use [-]."""

    preload_n: NotNegative = Control.preload
    """Least normal force of the hands [N]."""

    objective: Annotated[Objective, Field(strict=False)] = Control.objective
    """What the synthesis minimises."""

    feedforward: bool = True
    """Whether synthesised torques are applied at all."""

    best_effort: bool = False
    """Whether forces nearest to balance are applied where none balance the object."""

    solve_every: Count = Control.solve_every
    """Physics steps per synthesis."""

    bandwidth_rad_s: NotNegative = Control.bandwidth
    """Natural frequency of the joint impedance [rad/s]."""

    yielding_squeeze: bool = False
    """Whether the impedance leaves the hands' squeeze to the feed-forward."""

    inertia: bool = False
    """Whether forces also accelerate object and robot."""

    pose_filter_s: NotNegative = Control.pose_filter_s
    """Time constant with which the object's measured pose is smoothed [s]."""

    robustness: RobustnessTable | None = None
    """What the grip has to bear beyond that; controller robust has its own."""

    guard: GuardTable = GuardTable()
    """When a run is held, lowered or stopped."""


class PhysicsTable(Table):
    """Settings of the contact solver."""

    timestep_s: Annotated[Number, Field(ge=1e-5, le=1.0)] = Physics.timestep
    """Time step [s]."""

    impratio: Positive = Physics.impratio
    """Frictional to normal constraint impedance [-]."""

    noslip_iterations: Annotated[int, Field(strict=True, ge=0)] = Physics.noslip_iterations
    """Iterations of the noslip post-processing."""

    solref: Annotated[list[Positive], Len(2, 2)] = list(Physics.solref)
    """Contact time constant [s] and damping ratio [-]."""

    solimp: Annotated[list[Positive], Len(3, 3)] = list(Physics.solimp)
    """Contact impedance d0 and dmax [-], and width [m]."""

    solref_friction: Annotated[list[Positive], Len(2, 2)] = list(Physics.solref_friction)
    """Time constant [s] and damping ratio [-] of the friction directions."""


class DisturbedTable(Table):
    """What counts as success in a world that is not as believed; inf is not judged."""

    final_deg: Limit = DISTURBED.final_deg
    """Deviation of the final tilt [deg]."""

    error_deg: Limit = DISTURBED.error_deg
    """Tilt error at any time [deg]."""

    slip_mm: Limit = DISTURBED.slip_mm
    """Drift of the points that touch, of hands and supports [mm]."""

    support_slip_mm: Limit | None = DISTURBED.support_slip_mm
    """Drift at supports [mm]; slip_mm, if it is left out."""

    slide_mm: Limit | None = DISTURBED.slide_mm
    """How far contacts slide in all [mm]; slip_mm, if it is left out."""

    spin_deg: Limit = DISTURBED.spin_deg
    """Turn about the contact normal [deg]."""

    utilisation: Limit = DISTURBED.utilisation
    """Friction utilisation in the plant [-]."""

    force_error: Limit = DISTURBED.force_error
    """RMS of measured minus commanded normal force, over the peak commanded one [-]."""

    saturated_s: LimitOrZero = DISTURBED.saturated_s
    """How long a torque may be cut at its limit at a stretch [s]."""

    support_lost_s: LimitOrZero = DISTURBED.support_lost_s
    """How long a support may lose touch at a stretch [s]."""

    impact: Limit = DISTURBED.impact
    """Force of a hand that comes or goes, over its largest grip [-]."""

    collisions: bool = DISTURBED.collisions
    """Whether contacts that are not wanted count."""

    no_forces: bool = DISTURBED.no_forces
    """Whether it counts if the synthesis finds no forces."""

    given_up: bool = DISTURBED.given_up
    """Whether it counts if the guard lowers the object or stops the run."""


class TolerancesTable(Table):
    """What counts as success; inf is not judged."""

    final_deg: Limit = Tolerances.final_deg
    """Deviation of the final tilt [deg]."""

    error_deg: Limit = Tolerances.error_deg
    """Tilt error at any time [deg]."""

    slip_mm: Limit = Tolerances.slip_mm
    """Drift of the points that touch, of hands and supports [mm]."""

    support_slip_mm: Limit | None = Tolerances.support_slip_mm
    """Drift at supports [mm]; slip_mm, if it is left out."""

    slide_mm: Limit | None = Tolerances.slide_mm
    """How far contacts slide in all [mm]; slip_mm, if it is left out."""

    spin_deg: Limit = Tolerances.spin_deg
    """Turn about the contact normal [deg]."""

    utilisation: Limit = Tolerances.utilisation
    """Friction utilisation in the plant [-]."""

    force_error: Limit = Tolerances.force_error
    """RMS of measured minus commanded normal force, over the peak commanded one [-]."""

    saturated_s: LimitOrZero = Tolerances.saturated_s
    """How long a torque may be cut at its limit at a stretch [s]."""

    support_lost_s: LimitOrZero = Tolerances.support_lost_s
    """How long a support may lose touch at a stretch [s]."""

    impact: Limit = Tolerances.impact
    """Force of a hand that comes or goes, over its largest grip [-]."""

    collisions: bool = Tolerances.collisions
    """Whether contacts that are not wanted count."""

    no_forces: bool = Tolerances.no_forces
    """Whether it counts if the synthesis finds no forces."""

    given_up: bool = Tolerances.given_up
    """Whether it counts if the guard lowers the object or stops the run."""

    disturbed: DisturbedTable = DisturbedTable()
    """The same for runs with --preset or --world, and for sweeps."""


class ViewTable(Table):
    """Where recordings look from, relative to the path's point."""

    eye_m: Vector3 = list(View.eye)
    """Where the eye stands [m]."""

    target_m: Vector3 = list(View.target)
    """What it looks at [m]."""
