"""From a scenario file's tables of settings to the dataclasses of :mod:`sim.scenario.settings`."""

from __future__ import annotations

from dataclasses import replace

from fulcrum.scenarios.reading.places import vector
from fulcrum.scenarios.reading.source import Source
from fulcrum.scenarios.schema.settings import (
    ControlTable,
    DisturbedTable,
    ManoeuvreTable,
    PhysicsTable,
    RobustnessTable,
    TolerancesTable,
)
from fulcrum.sim.scenario.control import Control, Guard, Robustness
from fulcrum.sim.scenario.phases import HOLD, LEAVE, REACH, TILT, Phase, stretched
from fulcrum.sim.scenario.physics import Physics, Tolerances
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet


def phases(source: Source, table: ManoeuvreTable) -> tuple[Phase, ...]:
    """The phases of the manoeuvre.

    Raises:
        FileError: They are given in two ways.
    """
    if table.phases is None:
        after: tuple[Phase, ...] = HOLD
        if table.after == "leave":
            standoff = table.standoff_m
            after = tuple(replace(p, gap=standoff) if p.gap > 0.0 else p for p in LEAVE)
        lasts = (table.approach_s, table.touch_s, table.grip_s)
        reach = (replace(p, duration_s=d) for p, d in zip(REACH, lasts, strict=True))
        return stretched((*reach, *TILT, *after), table.tilt_s)
    for name in ("approach_s", "touch_s", "grip_s", "tilt_s", "after"):
        if name in table.model_fields_set:
            given = getattr(table, name)
            raise source.error(("manoeuvre", name), given, "left out where phases are given")
    return tuple(
        Phase(p.name, p.duration_s, tilt=p.tilt, gap=p.gap_m, grip=p.grip) for p in table.phases
    )


def control(table: ControlTable) -> Control:
    """The scenario's own control."""
    g = table.guard
    return Control(
        friction_factor=table.friction_factor,
        preload=table.preload_n,
        objective=table.objective,
        feedforward=table.feedforward,
        best_effort=table.best_effort,
        solve_every=table.solve_every,
        bandwidth=table.bandwidth_rad_s,
        yielding_squeeze=table.yielding_squeeze,
        robustness=None if table.robustness is None else _robustness(table.robustness),
        inertia=table.inertia,
        pose_filter_s=table.pose_filter_s,
        guard=Guard(
            silence_s=g.silence_s,
            no_forces_s=g.no_forces_s,
            blind_s=g.blind_s,
            tilt_error_deg=g.tilt_error_deg,
            joint_error=g.joint_error,
            joint_pull=g.joint_pull,
            saturated_s=g.saturated_s,
            torque_error=g.torque_error,
            contact_error=g.contact_error_m,
            hold_s=g.hold_s,
            holds_s=g.holds_s,
            lower_s=g.lower_s,
        ),
    )


def _robustness(table: RobustnessTable) -> Robustness:
    uncertainty = UncertaintySet(
        mass=table.mass,
        center=vector(table.center_m),
        friction=table.friction,
        push=vector(table.push_n),
        lever=vector(table.lever_m),
        placement=table.placement_m,
    )
    return Robustness(uncertainty, preload=table.preload_n, reaction=table.reaction_n)


def physics(table: PhysicsTable) -> Physics:
    """Settings of the contact solver."""
    (time, ratio), (friction_time, friction_ratio) = table.solref, table.solref_friction
    return Physics(
        timestep=table.timestep_s,
        impratio=table.impratio,
        noslip_iterations=table.noslip_iterations,
        solref=(time, ratio),
        solimp=vector(table.solimp),
        solref_friction=(friction_time, friction_ratio),
    )


def tolerances(table: TolerancesTable) -> Tolerances:
    """What counts as success."""
    return Tolerances(**table.model_dump(exclude={"disturbed"}))


def disturbed(table: DisturbedTable) -> Tolerances:
    """What counts as success in a world that is not as believed."""
    return Tolerances(**table.model_dump())
