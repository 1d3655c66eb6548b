"""`fulcrum run`: one run of a scenario, recorded and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import refuse, show
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.sim.run import Preparation, Request


@dataclass(frozen=True)
class RunCommand(common.Planned):
    """Run a scenario without a window; write recording, configuration and report; judge the run."""

    controller: common.MaybeText = None
    """Controller (see `fulcrum list`); by default robust, or dynamic with --plan."""

    objective: common.MaybeText = None
    """What the synthesis minimises (see `fulcrum list`); by default the scenario's own."""

    seed: int = 0
    """Seed of the world, and of the small deviations of the start posture."""

    preset: str = "nominal"
    """How far the simulated world may be off the model: nominal, lab, field or harsh."""

    world: str = ""
    """Parameters to set of the drawn world, as factors: friction=0.8,mass=1.1"""

    disturbed: bool = False
    """Judge by the tolerances for disturbed runs, as always with --world or another preset."""

    engine: str = "mujoco"
    """What simulates the robots and the object: mujoco, or drake if its extra is installed."""

    out: common.MaybePath = None
    """New or empty folder for the results; by default logs/SCENARIO-CONTROLLER-TIME."""

    live: bool = False
    """Open a viewer that follows the run."""

    best_effort: bool = False
    """Run even where no forces balance the object, with the forces nearest to balance."""

    def execute(self) -> int:
        """Run the command; return the exit code."""
        from fulcrum.sim.evaluation import Verdict
        from fulcrum.sim.planning import PlanError
        from fulcrum.sim.run import UnholdableError
        from fulcrum.sim.run.execute import execute as run
        from fulcrum.sim.scenario import default_controller

        try:
            request, prepared = self._request()
            assert request.out is not None
            with common.progress_bar(request.scenario.name) as progress:
                result = run(request, progress, prepared)
        except UnholdableError as error:
            show(error.explanation.page(self.controller or default_controller(planned=False)))
            refuse("no forces hold the object; --best-effort runs it with the nearest ones.")
            return common.FAILED
        except PlanError as error:
            refuse(f"{error}")
            return common.FAILED
        report = result.report
        show(result.page() + page(f"Recording: {request.out / (report.recording or '')}"))
        ended = {Verdict.PASS: common.PASSED, Verdict.INTERRUPTED: common.INTERRUPTED}
        return ended.get(report.verdict, common.FAILED)

    def told(self, error: Exception) -> str:
        """Return an error as a sentence, which says so where a run is refused."""
        from fulcrum.sim.motion import PathError

        told = super().told(error)
        refused = isinstance(error, PathError)
        return f"{told.rstrip('.')}. Refused: nothing has moved." if refused else told

    def _request(self) -> tuple[Request, Preparation]:
        """Return what to run, and what is prepared of it."""
        from fulcrum.scenarios.functions import chosen_engine, prepared_request
        from fulcrum.sim.world import parse_values

        common.check_results_folder(self.out)
        chosen, engine = self.chosen(), chosen_engine(self.engine)
        request, prepared = prepared_request(
            chosen,
            self.controller,
            self.objective,
            self.planning(chosen),
            self.duration,
            (self.preset, self.seed, parse_values("--world", self.world)),
            self.best_effort,
            self.disturbed,
        )
        # Nothing is written before the run is known to be possible.
        out = common.results_folder(self.out, f"{chosen.name}-{request.name}")
        return replace(request, out=out, live=self.live, engine=engine), prepared
