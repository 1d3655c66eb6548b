"""What functions and commands are asked for, checked: scenario, control, plan, world, run, sweep.

What is not valid raises InvalidInputError with the name of the argument; the command line writes
it as an option.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from fulcrum.scenarios.reading.library import scenario
from fulcrum.sim.planning import Planning, planned_tilt
from fulcrum.sim.plant import Engine, check_installed
from fulcrum.sim.run import Preparation, Request, prepare
from fulcrum.sim.scenario import (
    Control,
    Scenario,
    comparable,
    default_controller,
    stretched,
    tilting,
)
from fulcrum.sim.scenario import controller as named_controller
from fulcrum.sim.world import ParameterGrid, World, overridden, parameter_name, presets
from fulcrum.synthesis import InvalidInputError, Objective
from fulcrum.synthesis.checks import whole
from fulcrum.synthesis.path import PathObjective

if TYPE_CHECKING:
    from fulcrum.sim.sweep import Sweep

Asked = Scenario | str | Path
Choice = TypeVar("Choice", bound=StrEnum)


def as_scenario(asked: Asked) -> Scenario:
    """Return a scenario that is given as such, by its name, or by its file."""
    return asked if isinstance(asked, Scenario) else scenario(asked)


def chosen_control(scene: Scenario, controller: str, objective: str | None = None) -> Control:
    """Return the settings of a controller, with another objective if one is given."""
    control = named_controller(scene.control, controller)
    if objective is None:
        return control
    return replace(control, objective=one_of(Objective, "objective", objective))


def chosen_planning(
    scene: Scenario, plan: str | None, stretch: float, duration: float | None, robust: bool
) -> Planning | None:
    """Return how the tilt is planned; None if it is not."""
    if plan is not None:
        return asked_planning(scene, "plan", plan, stretch, duration, robust)
    for option, given, default in (("stretch", stretch, 1.0), ("robust", robust, False)):
        if given != default:
            raise InvalidInputError(option, given, "left out without a plan")
    return None


def asked_planning(
    scene: Scenario,
    field: str,
    objective: str,
    stretch: float,
    duration: float | None,
    robust: bool,
    points: int = Planning.points,
) -> Planning:
    """Return a plan as asked for, with the scene's own duration if the objective needs one."""
    kind = one_of(PathObjective, field, objective)
    if duration is None:
        own = sum(scene.phases[i].duration_s for i in tilting(scene.phases))
        duration = own if kind.needs_duration else math.inf
    return Planning(stretch, points, kind, duration, robust)


def chosen_engine(name: str) -> Engine:
    """Return the engine of a name, which must be installed."""
    engine = one_of(Engine, "engine", name)
    check_installed(engine)
    return engine


def one_of(kind: type[Choice], field: str, text: str) -> Choice:
    """Return the member of an enumeration that a text names."""
    if text not in list(kind):
        raise InvalidInputError(field, text, f"one of {', '.join(kind)}")
    return kind(text)


def prepared_request(
    scene: Scenario,
    controller: str | None,
    objective: str | None,
    planning: Planning | None,
    duration: float | None,
    worlds: tuple[str, int, Mapping[str, float]],
    best_effort: bool,
    disturbed: bool,
) -> tuple[Request, Preparation]:
    """Return what :func:`fulcrum.run` executes, and what is prepared of it; nothing is written.

    Args and errors are those of that function, but for ``worlds``: preset and seed of the world,
    and the parameters to set of it.
    """
    preset, seed, values = worlds
    whole("seed", seed, least=0)
    name = default_controller(planning is not None) if controller is None else controller
    control = chosen_control(scene, name, objective)
    if planning is None and duration is not None:
        scene = replace(scene, phases=stretched(scene.phases, duration))
    prepared = prepare(scene, control, best_effort, planning=planning)
    if prepared.execution is not None:
        scene = prepared.execution.scenario
    request = Request(
        scene,
        name,
        control,
        seed,
        best_effort=best_effort,
        world=drawn_world(scene, preset, seed, values),
        planning=planning,
        disturbed=disturbed or preset != "nominal" or bool(values),
    )
    return request, prepared


def drawn_world(scene: Scenario, preset: str, seed: int, values: Mapping[str, float]) -> World:
    """Return the world of a preset and seed, with some parameters set, as in a sweep's episode."""
    named = {parameter_name("world", key): value for key, value in values.items()}
    return overridden(presets.draw(presets.preset(preset), scene, seed), scene, named)


def sweep_design(
    scene: Scenario,
    episodes: int,
    controllers: tuple[str, ...] | None,
    preset: str,
    seed: int,
    grid: ParameterGrid,
    planning: Planning | None,
    called: str,
) -> Sweep:
    """Return what :func:`fulcrum.sweep` runs; replays name the scene as it is ``called``."""
    from fulcrum.sim.sweep import Sweep  # takes long to import

    if planning is not None:
        scene = planned_tilt(scene, planning).scenario
    names = controllers or comparable(scene.control, planned=planning is not None)
    return Sweep(scene, names, preset, episodes, seed, grid, planning, called)
