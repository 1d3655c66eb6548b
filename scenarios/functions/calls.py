"""The commands as functions of Python, with results instead of output: ``fulcrum.run(..)``, ..

Each takes a scenario, the name of one that ships, or a file. The commands call these functions.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.functions.requests import (
    Asked,
    as_scenario,
    asked_planning,
    chosen_control,
    chosen_engine,
    chosen_planning,
    one_of,
    prepared_request,
    sweep_design,
)
from fulcrum.sim.analysis import Explanation, Feasibility
from fulcrum.sim.analysis import capacity as capacity_analysis
from fulcrum.sim.analysis import explain as analysis
from fulcrum.sim.analysis.feasibility import feasibility
from fulcrum.sim.placement import Effort, Freedom, Goal, Placement
from fulcrum.sim.placement.search import SearchProgress, search
from fulcrum.sim.planning import Margins, PathProblems, Plan, made_plan, own_margins
from fulcrum.sim.run import LOCAL, Result, Workers, environment
from fulcrum.sim.run.execute import execute
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Progress
from fulcrum.sim.world import ParameterGrid
from fulcrum.synthesis import Synthesizer

if TYPE_CHECKING:
    from dm_control.rl.control import Environment

    from fulcrum.sim.sweep import SweepResult


def run(
    scenario: Asked,
    controller: str | None = None,
    *,
    objective: str | None = None,
    preset: str = "nominal",
    seed: int = 0,
    world: Mapping[str, float] | None = None,
    plan: str | None = None,
    stretch: float = 1.0,
    duration: float | None = None,
    robust: bool = False,
    out: Path | None = None,
    best_effort: bool = False,
    disturbed: bool = False,
    engine: str = "mujoco",
) -> Result:
    """Run a scenario in closed loop; return verdict, trace and contact history.

    Args:
        scenario: The scene.
        controller: Name; `robust` if left out, or `dynamic` with a plan.
        objective: What the synthesis minimises; the scenario's own if left out.
        preset: Uncertainty that the world is drawn from: `nominal`, `lab`, `field` or `harsh`.
        seed: Seed of the world, and of the small deviations of the start posture.
        world: Parameters to set of the drawn world, such as `{"friction": 0.8}` (factors).
        plan: Objective of the planned tilt to execute; None for the scenario's own timing.
        stretch: Factor on the planned duration.
        duration: Duration of the tilt [s]; with a plan the longest that it may have.
        robust: Whether the plan also holds for the uncertainty set of controller `robust`.
        out: New or empty folder for recording, configuration and report; None writes nothing.
        best_effort: Whether to run where no forces balance the object, with the nearest.
        disturbed: Whether to judge by the tolerances for disturbed runs, as it is always done
            with a preset other than `nominal` and with `world`.
        engine: What simulates the plant: `mujoco`, or `drake` if it is installed.

    Raises:
        InvalidInputError: An argument is not valid.
        PathError: The arms cannot follow the path.
        UnholdableError: No forces hold the object somewhere on the path.
        PlanError: The planned tilt breaks a limit.
    """
    scene, simulator = as_scenario(scenario), chosen_engine(engine)
    planning = chosen_planning(scene, plan, stretch, duration, robust)
    worlds = preset, seed, world or {}
    request, prepared = prepared_request(
        scene, controller, objective, planning, duration, worlds, best_effort, disturbed
    )
    return execute(replace(request, out=out, engine=simulator), prepared=prepared)


def sweep(
    scenario: Asked,
    episodes: int,
    controllers: tuple[str, ...] | None = None,
    *,
    preset: str = "field",
    seed: int = 0,
    grid: ParameterGrid = (),
    plan: str | None = None,
    stretch: float = 1.0,
    duration: float | None = None,
    robust: bool = False,
    out: Path | None = None,
    workers: Workers = LOCAL,
) -> SweepResult:
    """Run controllers in many drawn worlds; return one row per episode, and success rates.

    Args:
        scenario: The scene.
        episodes: Number of worlds per controller and point of the grid.
        controllers: Names; all with feed-forward if left out.
        preset: Uncertainty that worlds are drawn from: `nominal`, `lab`, `field` or `harsh`.
        seed: Seed of the first world; the next ones have the next seeds.
        grid: Parameters to set of every world, each with its values.
        plan: Objective of the planned tilt to execute; None for the scenario's own timing.
        stretch: Factor on the planned duration.
        duration: Longest duration of the planned tilt [s].
        robust: Whether the plan also holds for the uncertainty set of controller `robust`.
        out: Folder for the rows; an interrupted sweep is resumed there. None keeps no files.
        workers: Processes or cluster that run the episodes.

    Raises:
        InvalidInputError: An argument is not valid.
        PathError: The arms cannot follow the path.
        UnholdableError: A controller finds no forces somewhere on the path.
        PlanError: The planned tilt breaks a limit.
    """
    from fulcrum.sim.sweep import run_sweep

    scene = as_scenario(scenario)
    planning = chosen_planning(scene, plan, stretch, duration, robust)
    called = "" if isinstance(scenario, Scenario) else str(scenario)
    design = sweep_design(scene, episodes, controllers, preset, seed, grid, planning, called)
    with _folder(out) as folder:
        return run_sweep(design, folder, workers)


def make_environment(
    scenario: Asked, seed: int = 0, control_timestep: float | None = None
) -> Environment:
    """Return the scenario as a `dm_env` environment: joint torques in, states and forces out.

    Args:
        scenario: The scene.
        seed: Draws the deviations of the start posture.
        control_timestep: Time between actions [s]; that of the synthesis if left out.

    Raises:
        InvalidInputError: The time between actions is no multiple of the physics step.
        PathError: The arms cannot follow the path.
    """
    return environment.make_environment(as_scenario(scenario), seed, control_timestep)


def check(scenario: Asked, controller: str = "robust") -> Feasibility:
    """Check reach, joint limits, collisions and forces over the path before anything moves."""
    scene = as_scenario(scenario)
    return feasibility(scene, chosen_control(scene, controller))


def explain(
    scenario: Asked,
    tilt_deg: float | None = None,
    controller: str = "margin",
    objective: str | None = None,
) -> Explanation:
    """Explain why no forces exist and what would help, or the margins of those that do.

    Args:
        scenario: The scene.
        tilt_deg: Tilt [deg]; the first infeasible or else the tightest one if left out.
        controller: Name of the controller whose margins count.
        objective: What the synthesis minimises; the scenario's own if left out.

    Raises:
        InvalidInputError: The tilt is not on the path, or there is no such controller.
        PathError: The arms cannot follow the path.
    """
    scene = as_scenario(scenario)
    control = chosen_control(scene, controller, objective)
    problems, synthesizer = PathProblems(scene, control), Synthesizer()
    if tilt_deg is None:
        tilt_deg = analysis.tightest_tilt(problems, synthesizer)
    return analysis.explain(problems, tilt_deg, synthesizer)


def capacity(
    scenario: Asked, controller: str = "margin", progress: Progress | None = None
) -> tuple[capacity_analysis.Capacity, ...]:
    """Find the heaviest object that can be pivoted (if there are supports), and lifted.

    Args:
        scenario: The scene.
        controller: Name of the controller whose margins count.
        progress: Called with tilts done and tilts in total.
    """
    scene = as_scenario(scenario)
    return capacity_analysis.capacities(scene, chosen_control(scene, controller), progress)


def place(
    scenario: Asked,
    goal: str = "largest-margin",
    controller: str = "robust",
    *,
    freedom: Freedom | None = None,
    effort: Effort | None = None,
    progress: SearchProgress | None = None,
) -> Placement:
    """Search for a better base, contact places and posture; the result has passed in closed loop.

    Args:
        scenario: The scene as it is placed now.
        goal: What is improved: `largest-margin`, `lowest-torque` or `heaviest`.
        controller: Name of the controller whose margins count, and which runs what was found.
        freedom: What may move, and how far.
        effort: Limits of the search: evaluations, time, processes.
        progress: Called with placements done and in total, and a note.

    Raises:
        InvalidInputError: An argument is not valid.
    """
    scene, chosen = as_scenario(scenario), one_of(Goal, "goal", goal)
    return search(scene, controller, chosen, freedom, effort, progress)


def plan(
    scenario: Asked,
    objective: str = "least-time",
    *,
    stretch: float = 1.0,
    duration: float | None = None,
    robust: bool = False,
    points: int = 100,
    margins: Margins | None = None,
) -> Plan:
    """Plan timing and forces of the tilt.

    Args:
        scenario: The scene.
        objective: What is optimised: `least-time`, `least-effort` or `friction-margin`.
        stretch: Factor on the planned duration.
        duration: Longest duration [s]; the scenario's own, where the objective needs one.
        robust: Whether the plan also holds for the uncertainty set of controller `robust`.
        points: Number of grid points along the path.
        margins: Distance to the limits; those of the scenario's control if left out.

    Raises:
        InvalidInputError: An argument is not valid.
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits.
    """
    scene = as_scenario(scenario)
    planning = asked_planning(scene, "objective", objective, stretch, duration, robust, points)
    return made_plan(scene, margins or own_margins(scene.control), planning)


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """Yield the folder asked for, or one that is removed in the end."""
    if out is not None:
        yield out
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)
