"""One run of a scenario into a folder: recording, resolved configuration, report."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import signal
import threading
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import Any

from fulcrum.sim.control.replanning import Replanner
from fulcrum.sim.evaluation.judge import Judge
from fulcrum.sim.evaluation.monitor import ContactHistory, Monitor
from fulcrum.sim.evaluation.report import Report, RunInfo
from fulcrum.sim.planning.execution import Planning
from fulcrum.sim.plant.engines import Engine
from fulcrum.sim.recording import Recorder, open_viewer
from fulcrum.sim.run.files import check_new_folder, finite, write_json
from fulcrum.sim.run.loop import ClosedLoop, DivergedError
from fulcrum.sim.run.notebook import report_markdown
from fulcrum.sim.run.preparation import Preparation, prepare
from fulcrum.sim.scenario.control import Control, controller, default_controller
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.trace import Trace
from fulcrum.sim.world.world import NO_DEVIATION, World

RECORDING, CONFIG, REPORT = "run.rrd", "config.json", "report.json"
# Whose versions may change a run's numbers.
PACKAGES = ("mujoco", "dm-control", "mink", "pin", "clarabel", "rerun-sdk", "numpy", "scipy")

Progress = Callable[[int, int], None]


@dataclasses.dataclass(frozen=True)
class Request:
    """What to run.

    Attributes:
        scenario: The scene.
        controller: Name of the controller; robust if left out, or dynamic with a planned tilt.
        control: Settings to run with instead of those that the name stands for.
        seed: Draws the small deviations of the start posture.
        out: Folder for recording, configuration and report; None writes nothing.
        live: Whether to open a viewer that follows the run (with ``out`` only).
        anyway: Whether to run although the synthesis finds no forces somewhere on the path.
        world: What is true of the plant beyond the scenario; nothing else by default.
        planning: How the tilt is planned; None for the scenario's own timing.
        engine: What simulates the plant.
    """

    scenario: Scenario
    controller: str | None = None
    control: Control | None = None
    seed: int = 0
    out: Path | None = None
    live: bool = False
    anyway: bool = False
    world: World = NO_DEVIATION
    planning: Planning | None = None
    engine: Engine = Engine.MUJOCO

    def __post_init__(self) -> None:
        _ = self.settings  # a name that stands for none is refused

    @property
    def name(self) -> str:
        """Name of the controller, given or not."""
        if self.controller is None:
            return default_controller(self.planning is not None)
        return self.controller

    @property
    def settings(self) -> Control:
        """The controller's settings, given or not."""
        if self.control is None:
            return controller(self.scenario.control, self.name)
        return self.control


@dataclasses.dataclass(frozen=True, eq=False)
class Result:
    """What a run gave: the verdict and all that it rests on; what ended it, if something did."""

    report: Report
    trace: Trace
    history: ContactHistory
    error: str | None = None

    def _repr_markdown_(self) -> str:
        from fulcrum.sim.run.notebook import result_markdown

        return result_markdown(self)


def execute(
    request: Request,
    progress: Progress | None = None,
    prepared: Preparation | None = None,
) -> Result:
    """Runs to the end, or until interrupted (SIGINT, SIGTERM), and leaves a complete record.

    Args:
        request: What to run.
        progress: Called with steps done and steps in total after every block.
        prepared: What :func:`prepare` gives for the request, where that has been done already.

    Raises:
        PathError: The arms cannot follow the path; nothing has moved.
        InvalidInputError: The scenario contradicts itself, or the folder holds something.
        UnholdableError: The synthesis finds no forces somewhere on the path, and the request does
            not say to run anyway.
        PlanError: The planned tilt breaks a limit.
        DivergedError: The simulation diverged in its first step.
    """
    out, control = request.out, request.settings
    if out is not None:
        check_new_folder("out", out)
    if prepared is None:
        check, planning = not request.anyway, request.planning
        prepared = prepare(request.scenario, control, check, planning=planning)
    execution, replanner = prepared.execution, None
    if execution is not None:
        request = dataclasses.replace(request, scenario=execution.scenario)
        replanner = Replanner(execution) if control.inertia else None
    loop = ClosedLoop(
        request.scenario,
        control,
        seed=request.seed,
        joint_path=prepared.joint_path,
        world=request.world,
        grip=prepared.grip,
        replanner=replanner,
        engine=request.engine,
    )
    monitor = Monitor(loop.truth)
    robot = loop.robot
    judge = Judge(loop.truth, robot.joints, robot.tau_min, robot.tau_max)
    recorder = None
    histories: list[ContactHistory] = []
    error: str | None = None
    viewer_url = open_viewer() if request.live and out is not None else None
    # From the first file to the last, so that none is missing.
    with _quick_collections(), _StopSignal() as stop:
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            config = resolved_config(request)
            write_json(out / CONFIG, config)
            limits = robot.tau_min, robot.tau_max
            recorder = Recorder(
                out / RECORDING,
                loop.truth,
                config,
                robot.joints,
                *limits,
                plan=None if execution is None else execution.plan,
                viewer_url=viewer_url,
            )
        started = time.perf_counter()
        try:
            for block in loop.run():
                histories.append(monitor.update(block))
                if recorder is not None:
                    recorder.write(block, histories[-1])
                if progress is not None:
                    progress(loop.steps, loop.total_steps)
                if stop.requested:
                    break
        except DivergedError as diverged:
            if not histories:
                raise
            error = f"{diverged}"
        info = RunInfo(
            controller=request.name,
            objective=control.objective,
            seed=request.seed,
            wall_s=time.perf_counter() - started,
            interrupted=stop.requested,
            error=error,
            recording=None if out is None else RECORDING,
            collisions=loop.collisions,
            events=loop.events,
        )
        history = ContactHistory.concatenate(histories)
        trace = loop.trace
        report = judge.report(info, trace, history)
        if out is not None and recorder is not None:
            write_json(out / REPORT, dataclasses.asdict(report))
            recorder.close(report_markdown(report))
    return Result(report, trace, history, error)


@contextlib.contextmanager
def _quick_collections() -> Iterator[None]:
    """Keeps the garbage collector from what is older than a run, which takes it 80 ms to search."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


class _StopSignal:
    """Turns Ctrl-C and SIGTERM into a request to stop after the present block."""

    def __init__(self) -> None:
        self.requested = False
        self._previous: dict[signal.Signals, Any] = {}

    def __enter__(self) -> _StopSignal:
        if threading.current_thread() is not threading.main_thread():
            return self  # signals go to the main thread, and only it may say what they do
        for number in (signal.SIGINT, signal.SIGTERM):
            self._previous[number] = signal.signal(number, self._request)
        return self

    def _request(self, number: int, frame: FrameType | None) -> None:
        self.requested = True

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)


def resolved_config(request: Request) -> dict[str, Any]:
    """Everything that determines the run, for JSON; infinite limits become null."""
    return finite(
        {
            "controller": request.name,
            "engine": request.engine.value,
            "seed": request.seed,
            "control": dataclasses.asdict(request.settings),
            "scenario": dataclasses.asdict(request.scenario),
            "world": dataclasses.asdict(request.world),
            "planning": None if request.planning is None else dataclasses.asdict(request.planning),
            "versions": {name: version(name) for name in PACKAGES},
        }
    )
