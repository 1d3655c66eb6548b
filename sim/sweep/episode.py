"""One episode as a flat row: its true world, its measurements, and the cause of a failure."""

from __future__ import annotations

import dataclasses
import pickle
import time
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from fulcrum.sim.evaluation import Outcome, Verdict
from fulcrum.sim.model import RobotModel
from fulcrum.sim.motion import plan_joints
from fulcrum.sim.planning import planned_tilt
from fulcrum.sim.plant import DivergedError
from fulcrum.sim.run import Preparation, Request, Result, finite, prepare
from fulcrum.sim.run.execute import execute
from fulcrum.sim.scenario import Control, Scenario, controllers
from fulcrum.sim.signals import stretches
from fulcrum.sim.sweep.design import Episode, Sweep
from fulcrum.sim.world import PARAMETERS, World
from fulcrum.synthesis import FulcrumError

Row = dict[str, Any]


@dataclasses.dataclass(frozen=True, eq=False)
class Prepared:
    """The data that all episodes of a sweep share; they are computed once per process.

    Attributes:
        sweep: Sweep of the episodes.
        controls: Settings by controller.
        preparations: Plans by controller; they do not depend on the true world.
        joints: Names of the robot's joints.
    """

    sweep: Sweep
    controls: dict[str, Control]
    preparations: dict[str, Preparation]
    joints: tuple[str, ...]


@lru_cache(maxsize=4)
def prepared(packed: bytes) -> Prepared:
    """Return the shared data of a pickled sweep.

    Raises:
        PathError: The arms cannot follow the path.
    """
    sweep: Sweep = pickle.loads(packed)
    known = controllers(sweep.scenario.control)
    controls = {name: known[name] for name in sweep.controllers}
    preparations = _prepared(sweep, controls)
    return Prepared(
        sweep=sweep,
        controls=controls,
        preparations=preparations,
        joints=next(iter(preparations.values())).robot.joints,
    )


def _prepared(sweep: Sweep, controls: dict[str, Control]) -> dict[str, Preparation]:
    scenario, robot = sweep.scenario, RobotModel(sweep.scenario)
    if sweep.planning is not None:
        planned = planned_tilt(scenario, sweep.planning, robot)
        preparation = Preparation(robot, planned.joint_path, planned.grip, planned)
        return dict.fromkeys(controls, preparation)
    path = plan_joints(scenario)
    return {
        name: prepare(scenario, control, joint_path=path, robot=robot)
        for name, control in controls.items()
    }


def check_holdable(sweep: Sweep) -> None:
    """Check that the scenario of a sweep is feasible without deviations.

    Raises:
        PathError: The arms cannot follow the path.
        UnholdableError: A controller finds no forces somewhere on the path.
    """
    if sweep.planning is not None:
        return  # a planned tilt has been checked by its plan
    known = controllers(sweep.scenario.control)
    for name in sweep.controllers:
        prepare(sweep.scenario, known[name])


def run_episode(packed: bytes, episode: Episode) -> Row:
    """Run an episode of a pickled sweep without a recording.

    The name of a column is the path to its value. Columns of the true world begin with ``world.``;
    the others, after the first few, are named as in the report of a run.
    """
    shared = prepared(packed)
    sweep = shared.sweep
    started, computed = time.perf_counter(), time.thread_time()
    control = shared.controls[episode.controller]
    world = sweep.world(episode)
    row: Row = {
        "episode": episode.number,
        "controller": episode.controller,
        "seed": episode.seed,
        "success": False,
        "cause": None,
        "category": None,
        "failed_at_s": None,
        "outcome": None,
        "error": None,
        "replay": sweep.replay(episode),
        **_truths(world, sweep.scenario, shared.joints),
    }
    request = Request(
        sweep.scenario,
        episode.controller,
        control,
        episode.seed,
        world=world,
        planning=sweep.planning,
        disturbed=True,
    )
    try:
        result = execute(request, prepared=shared.preparations[episode.controller])
    except Exception as error:  # any error fails the episode, not the sweep
        text = f"{type(error).__name__}: {error}"
        row |= {"cause": "error", "category": "error", "failed_at_s": 0.0, "error": text}
        row["outcome"] = unstarted(error)
    else:
        row |= figures(shared, result)
    row["wall_s"] = time.perf_counter() - started
    row["cpu_s"] = time.thread_time() - computed
    return finite(row)


def unstarted(error: Exception) -> Outcome | None:
    """Return the outcome of a run that ended before its first step; None for other errors."""
    if isinstance(error, DivergedError):
        return Outcome.DIVERGED
    return Outcome.REFUSED if isinstance(error, FulcrumError) else None


def figures(shared: Prepared, result: Result) -> Row:
    """Return a run's measurements, its verdict and the cause of a failure."""
    scenario, trace, found = shared.sweep.scenario, result.trace, result.report.failures
    report = dataclasses.asdict(result.report)
    for whole_run in ("scenario", "controller", "seed", "disturbed", "recording", "phases"):
        report.pop(whole_run)
    report["failures"] = " ".join(result.report.sentences)
    longest = [int(stretches(trace.saturated[:, i]).max()) for i in range(len(shared.joints))]
    worst = max(range(len(longest)), key=longest.__getitem__)
    return {
        "success": result.report.verdict is Verdict.PASS,
        "cause": found[0].cause if found else None,
        "category": found[0].category if found else None,
        "failed_at_s": found[0].t if found else None,
        "error": result.error,
        **_flat("", report),
        **{
            f"contacts.{name}.held_slip_mm": 1e3 * float(result.history.slip[:, i].max())
            for i, name in enumerate(scenario.contact_names)
        },
        "torque.longest_saturated_s": longest[worst] * scenario.physics.timestep,
        "torque.longest_saturated_joint": shared.joints[worst] if longest[worst] else None,
    }


def _truths(world: World, scenario: Scenario, joints: tuple[str, ...]) -> Row:
    """Return all numbers of a world by contact, hand or joint, and the parameters of grids."""
    names: dict[str, Sequence[str]] = {
        "friction": scenario.contact_names,
        "hand_place": tuple(hand.name for hand in scenario.hands),
        **dict.fromkeys(("link_mass", "joint_friction", "torque_gain", "torque_offset"), joints),
    }
    truths = {
        key: dict(zip(names[key], value, strict=False)) if key in names else value
        for key, value in dataclasses.asdict(world).items()
    }
    known = {f"world.{n}": p.read(world, scenario) for n, p in PARAMETERS.items()}
    return {**known, **_flat("world.", truths)}


def _flat(prefix: str, values: Mapping[str, Any]) -> Row:
    """Return nested values as one level, with dots in the names."""
    row: Row = {}
    for key, value in values.items():
        if isinstance(value, (list, tuple)):
            axes = "xyz" if len(value) == 3 else "to" if len(value) == 2 else ""
            if not all(isinstance(item, float) for item in value):
                axes = ""
            labels = axes or map(str, range(len(value)))
            row |= _flat(f"{prefix}{key}.", dict(zip(labels, value, strict=True)))
        elif isinstance(value, Mapping):
            row |= _flat(f"{prefix}{key}.", value)
        else:
            row[f"{prefix}{key}"] = value
    return row
