"""`fulcrum run`: one run of a scenario, recorded and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands.common import (
    FAILED,
    INTERRUPTED,
    PASSED,
    Chosen,
    check_results_folder,
    chosen_control,
    chosen_engine,
    chosen_planning,
    progress_bar,
    results_folder,
)
from fulcrum.scenarios.commands.terminal import refuse, show
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.sim.run import Preparation, Request


@dataclass(frozen=True)
class RunCommand(Chosen):
    """Run a scenario headless; write recording, configuration and report; print the verdict."""

    controller: str | None = None
    """See `fulcrum list`; robust if left out, or dynamic with a plan."""

    objective: str | None = None
    """What the synthesis minimises (see `fulcrum list`); the scenario's own if left out."""

    plan: str | None = None
    """least-time, least-effort or friction-margin: plan the tilt as `fulcrum plan` does, and
    execute that."""

    stretch: float = 1.0
    """By how much the planned duration is stretched."""

    robust: bool = False
    """The plan also serves the uncertainty set of controller robust, or as much as it can."""

    duration: float | None = None
    """Duration of the tilt [s], or the longest that a plan may take; the scenario's own if left
    out."""

    seed: int = 0
    """Draws the small deviations of the start posture, and the world."""

    preset: str = "nominal"
    """How far the world may be from what is believed: nominal, lab, field or harsh."""

    world: str = ""
    """What to set of the world that was drawn, like friction=0.8,mass=1.1 (factors)."""

    disturbed: bool = False
    """Judge by the scenario's tolerances for disturbed runs, as sweeps do, and as it is done with
    --world and every preset but nominal."""
    engine: str = "mujoco"
    """What simulates the plant: mujoco or drake (which needs the extra `drake`)."""

    out: Path | None = None
    """New or empty folder for the results; logs/SCENARIO-CONTROLLER-TIME if left out."""

    live: bool = False
    """Open a viewer that follows the run."""

    best_effort: bool = False
    """Run with forces as near to balance as the limits allow where none balance the object."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from fulcrum.sim.evaluation import Verdict
        from fulcrum.sim.planning import PlanError
        from fulcrum.sim.run import UnholdableError
        from fulcrum.sim.run.execute import execute as run

        try:
            request, prepared = self._request()
            assert request.out is not None
            with progress_bar(request.scenario.name) as progress:
                result = run(request, progress, prepared)
        except UnholdableError as error:
            show(error.explanation.page(self.controller or "robust"))
            refuse("--best-effort shows what happens.")
            return FAILED
        except PlanError as error:
            refuse(f"{error}")
            return FAILED
        report = result.report
        show(result.page() + page(f"Recording: {request.out / (report.recording or '')}"))
        codes = {Verdict.PASS: PASSED, Verdict.FAIL: FAILED, Verdict.INTERRUPTED: INTERRUPTED}
        return codes[report.verdict]

    def told(self, error: Exception) -> str:
        """Return an error as a sentence, which says so where a run is refused."""
        from fulcrum.sim.motion import PathError

        told = super().told(error)
        refused = isinstance(error, PathError)
        return f"{told.rstrip('.')}. Refused: nothing has moved." if refused else told

    def _request(self) -> tuple[Request, Preparation]:
        """Return what to run, and what is prepared of it."""
        from fulcrum.scenarios.commands.sweep import drawn_world
        from fulcrum.sim.run import Request, prepare
        from fulcrum.sim.scenario import default_controller, stretched
        from fulcrum.synthesis import InvalidInputError

        check_results_folder(self.out)
        chosen = self.chosen()
        asked = self.plan, self.stretch, self.duration, self.robust
        planning = chosen_planning(chosen, *asked)
        controller = default_controller(planning is not None)
        if self.controller is not None:
            controller = self.controller
        control = chosen_control(chosen, controller, self.objective)
        if self.seed < 0:
            raise InvalidInputError("--seed", self.seed, "an integer >= 0")
        if planning is None and self.duration is not None:
            chosen = replace(chosen, phases=stretched(chosen.phases, self.duration))
        prepared = prepare(chosen, control, self.best_effort, planning=planning)
        if prepared.execution is not None:
            chosen = prepared.execution.scenario
        world = drawn_world(chosen, self.preset, self.seed, self.world)
        # Nothing is written before the run is known to be possible.
        out = results_folder(self.out, f"{chosen.name}-{controller}")
        how = self.seed, out, self.live, self.best_effort
        disturbed = self.disturbed or self.preset != "nominal" or bool(self.world)
        engine = chosen_engine(self.engine)
        request = Request(chosen, controller, control, *how, world, planning, disturbed, engine)
        return request, prepared
