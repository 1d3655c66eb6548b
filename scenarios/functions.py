"""The commands as functions of Python, with results instead of output: ``fulcrum.run(..)``, ..

Each takes a scenario, the name of one that ships, or a file.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands.common import asked_planning, one_of
from fulcrum.scenarios.reading.library import scenario as named_scenario
from fulcrum.sim.analysis import Explanation, Feasibility
from fulcrum.sim.analysis import capacity as capacity_analysis
from fulcrum.sim.analysis import explain as analysis
from fulcrum.sim.analysis.feasibility import feasibility
from fulcrum.sim.placement import Effort, Freedom, Goal, Placement
from fulcrum.sim.placement.search import search
from fulcrum.sim.planning import PathProblems, Plan, made_plan, own_margins
from fulcrum.sim.run import LOCAL, Request, Result, Workers, environment, prepare
from fulcrum.sim.run.execute import execute
from fulcrum.sim.scenario import Control, Scenario, comparable, default_controller
from fulcrum.sim.scenario import controller as named_controller
from fulcrum.sim.sweep import Sweep, SweepResult, run_sweep
from fulcrum.sim.world import ParameterGrid, overridden, parameter_name, presets
from fulcrum.synthesis import Synthesizer

if TYPE_CHECKING:
    from dm_control.rl.control import Environment

Asked = Scenario | str | Path


def run(
    scenario: Asked,
    controller: str | None = None,
    *,
    preset: str = "nominal",
    seed: int = 0,
    world: Mapping[str, float] | None = None,
    plan: str | None = None,
    stretch: float = 1.0,
    robust: bool = False,
    out: Path | None = None,
    best_effort: bool = False,
) -> Result:
    """Run a scenario in closed loop; return verdict, trace and contact history.

    Args:
        scenario: The scene.
        controller: Name; `robust` if left out, or `dynamic` with a plan.
        preset: Uncertainty that the world is drawn from: `nominal`, `lab`, `field` or `harsh`.
        seed: Draws the world, and the small deviations of the start posture.
        world: Parameters to set of the drawn world, such as `{"friction": 0.8}` (factors).
        plan: Objective of the planned tilt to execute; None for the scenario's own timing.
        stretch: Factor on the planned duration.
        robust: Whether the plan also serves the uncertainty set of controller `robust`.
        out: New or empty folder for recording, configuration and report; None writes nothing.
        best_effort: Whether to run where no forces balance the object, with the nearest.

    Raises:
        InvalidInputError: An argument is not valid.
        PathError: The arms cannot follow the path.
        UnholdableError: No forces hold the object somewhere on the path.
        PlanError: The planned tilt breaks a limit.
    """
    scene = _scene(scenario)
    name = controller or default_controller(plan is not None)
    control = _control(scene, name)
    planning = None
    if plan is not None:
        planning = asked_planning(scene, "plan", plan, stretch, None, robust)
    prepared = prepare(scene, control, best_effort, planning=planning)
    if prepared.execution is not None:
        scene = prepared.execution.scenario
    set_values = {parameter_name("world", key): value for key, value in (world or {}).items()}
    drawn = overridden(presets.draw(presets.preset(preset), scene, seed), scene, set_values)
    request = Request(
        scene,
        name,
        control,
        seed,
        out,
        best_effort=best_effort,
        world=drawn,
        planning=planning,
    )
    return execute(request, prepared=prepared)


def sweep(
    scenario: Asked,
    episodes: int,
    controllers: tuple[str, ...] | None = None,
    *,
    preset: str = "field",
    seed: int = 0,
    grid: ParameterGrid = (),
    out: Path | None = None,
    workers: Workers = LOCAL,
) -> SweepResult:
    """Run controllers in many drawn worlds; return one row per episode, and success rates.

    Args:
        scenario: The scene.
        episodes: Number of worlds per controller and point of the grid.
        controllers: Names; all with feed-forward if left out.
        preset: Uncertainty that worlds are drawn from: `nominal`, `lab`, `field` or `harsh`.
        seed: Seed of the first world; the next have the next.
        grid: Parameters to set of every world, each with its values.
        out: Folder for the rows; an interrupted sweep is resumed there. None keeps no files.
        workers: Who runs the episodes.

    Raises:
        InvalidInputError: An argument is not valid.
        PathError: The arms cannot follow the path.
        UnholdableError: A controller finds no forces somewhere on the path.
    """
    scene = _scene(scenario)
    names = controllers or comparable(scene.control, planned=False)
    called = "" if isinstance(scenario, Scenario) else str(scenario)
    design = Sweep(scene, names, preset, episodes, seed, grid, called=called)
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
    return environment.make_environment(_scene(scenario), seed, control_timestep)


def check(scenario: Asked, controller: str = "robust") -> Feasibility:
    """Check reach, joint limits, collisions and forces over the path before anything moves."""
    scene = _scene(scenario)
    return feasibility(scene, _control(scene, controller))


def explain(
    scenario: Asked, tilt_deg: float | None = None, controller: str = "margin"
) -> Explanation:
    """Explain why no forces exist and what would help, or the margins of those that do.

    Args:
        scenario: The scene.
        tilt_deg: Tilt [deg]; the first infeasible or else the tightest one if left out.
        controller: Name of the controller whose margins count.

    Raises:
        InvalidInputError: The tilt is not on the path, or there is no such controller.
        PathError: The arms cannot follow the path.
    """
    scene = _scene(scenario)
    problems, synthesizer = PathProblems(scene, _control(scene, controller)), Synthesizer()
    if tilt_deg is None:
        tilt_deg = analysis.tightest_tilt(problems, synthesizer)
    return analysis.explain(problems, tilt_deg, synthesizer)


def capacity(scenario: Asked, controller: str = "margin") -> tuple[capacity_analysis.Capacity, ...]:
    """Find the heaviest object that can be pivoted (if there are supports), and lifted."""
    scene = _scene(scenario)
    return capacity_analysis.capacities(scene, _control(scene, controller))


def place(
    scenario: Asked,
    goal: str = "largest-margin",
    controller: str = "robust",
    *,
    freedom: Freedom | None = None,
    effort: Effort | None = None,
) -> Placement:
    """Search for a better base, contact places and posture; the result has passed in closed loop.

    Args:
        scenario: The scene as it is placed now.
        goal: What is improved: `largest-margin`, `lowest-torque` or `heaviest`.
        controller: Name of the controller whose margins count, and which runs what was found.
        freedom: What may move, and how far.
        effort: Limits of the search: evaluations, time, processes.

    Raises:
        InvalidInputError: An argument is not valid.
    """
    return search(_scene(scenario), controller, one_of(Goal, "goal", goal), freedom, effort)


def plan(
    scenario: Asked,
    objective: str = "least-time",
    *,
    stretch: float = 1.0,
    duration: float | None = None,
    robust: bool = False,
    points: int = 100,
) -> Plan:
    """Plan timing and forces of the tilt, with the margins of the scenario's control.

    Args:
        scenario: The scene.
        objective: What is optimised: `least-time`, `least-effort` or `friction-margin`.
        stretch: Factor on the planned duration.
        duration: Longest duration [s]; the scenario's own, where the objective needs one.
        robust: Whether the plan also serves the uncertainty set of controller `robust`.
        points: Number of grid points along the path.

    Raises:
        InvalidInputError: An argument is not valid.
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits.
    """
    scene = _scene(scenario)
    planning = asked_planning(scene, "objective", objective, stretch, duration, robust, points)
    return made_plan(scene, own_margins(scene.control), planning)


def _scene(asked: Asked) -> Scenario:
    return asked if isinstance(asked, Scenario) else named_scenario(asked)


def _control(scene: Scenario, name: str) -> Control:
    return named_controller(scene.control, name)


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """The folder asked for, or one that is removed in the end."""
    if out is not None:
        yield out
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)
