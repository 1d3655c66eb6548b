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
    chosen_control,
    chosen_engine,
    chosen_planning,
    progress_bar,
    results_folder,
)

if TYPE_CHECKING:
    from fulcrum.sim.evaluation.report import Report
    from fulcrum.sim.run.execute import Request
    from fulcrum.sim.run.preparation import Preparation


@dataclass(frozen=True)
class Run(Chosen):
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

    engine: str = "mujoco"
    """What simulates the plant: mujoco or drake (which needs the extra `drake`)."""

    out: Path | None = None
    """New or empty folder for the results; logs/SCENARIO-CONTROLLER-TIME if left out."""

    live: bool = False
    """Open a viewer that follows the run."""

    anyway: bool = False
    """Run with forces as near to balance as the limits allow where none balance the object."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from rich.console import Console

        from fulcrum.scenarios.commands.explain import print_explanation
        from fulcrum.scenarios.commands.sweep import print_outcome
        from fulcrum.sim.evaluation.report import Verdict
        from fulcrum.sim.planning.plan import PlanError
        from fulcrum.sim.run.execute import execute as run
        from fulcrum.sim.run.preparation import UnholdableError

        try:
            request, prepared = self._request()
            assert request.out is not None
            with progress_bar(request.scenario.name) as progress:
                result = run(request, progress, prepared)
        except UnholdableError as error:
            console, controller = Console(highlight=False), self.controller or "robust"
            print_explanation(console, error.explanation, controller)
            print("Nothing has moved; --anyway shows what happens.")
            return FAILED
        except PlanError as error:
            print(error)
            return FAILED
        report = result.report
        _print_report(report, request.out)
        if self.preset != "nominal" or self.world:
            print_outcome(request.scenario, result)
        codes = {Verdict.PASS: PASSED, Verdict.FAIL: FAILED, Verdict.INTERRUPTED: INTERRUPTED}
        return codes[report.verdict]

    def _request(self) -> tuple[Request, Preparation | None]:
        """What to run, and what is prepared of it: a planned tilt, if there is to be one."""
        from fulcrum.scenarios.commands.sweep import drawn_world
        from fulcrum.sim.planning.execution import planned_tilt
        from fulcrum.sim.run.execute import Request
        from fulcrum.sim.run.preparation import Preparation
        from fulcrum.sim.scenario.control import default_controller
        from fulcrum.sim.scenario.phases import stretched
        from fulcrum.synthesis.errors import InvalidInputError

        chosen = self.chosen()
        asked = self.plan, self.stretch, self.duration, self.robust
        planning, prepared = chosen_planning(chosen, *asked), None
        controller = default_controller(planning is not None)
        if self.controller is not None:
            controller = self.controller
        control = chosen_control(chosen, controller, self.objective)
        if planning is not None:
            planned = planned_tilt(chosen, planning)
            chosen, prepared = planned.scenario, Preparation.of(planned)
        elif self.duration is not None:
            chosen = replace(chosen, phases=stretched(chosen.phases, self.duration))
        if self.seed < 0:
            raise InvalidInputError("--seed", self.seed, "an integer >= 0")
        if self.anyway:
            control = replace(control, best_effort=True)
        world = drawn_world(chosen, self.preset, self.seed, self.world)
        out = results_folder(self.out, f"{chosen.name}-{controller}")
        request = Request(
            chosen, controller, control, self.seed, out, self.live, self.anyway, world, planning
        )
        return replace(request, engine=chosen_engine(self.engine)), prepared


def _print_report(report: Report, out: Path) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    colors = {"pass": "green", "fail": "red", "interrupted": "yellow"}
    verdict = f"[bold {colors[report.verdict]}]{report.verdict.upper()}[/]"
    console.print(f"{report.scenario}, controller {report.controller}: {verdict}")
    for failure in report.failures:
        console.print(f"  - {failure}", highlight=False)
    for event in report.events:
        console.print(f"  {event.t:.3f} s: {event.cause}: {event.reaction}", highlight=False)
    table = Table("contact", "kept", "slip", "slide", "spin", "friction", "force error", box=SIMPLE)
    table.add_row(*map(escape, ("", "[%]", "[mm]", "[mm]", "[deg]", "[%]", "[N]")), style="dim")
    for name, c in report.contacts.items():
        table.add_row(
            name,
            f"{c.kept_percent:.1f}",
            f"{c.slip_mm:.3f}",
            f"{c.slide_mm:.3f}",
            f"{c.spin_deg:.3f}",
            f"{100 * c.max_utilisation:.0f}",
            f"{c.force_error_rms_n:.2f}",
        )
    console.print(table)
    tilt, torque, timing = report.tilt, report.torque, report.timing
    console.print(
        f"tilt {tilt.final_deg:z.2f} of {tilt.target_deg:g} deg, error at most "
        f"{tilt.max_error_deg:.3f} deg; torque at most {100 * torque.max_utilisation:.0f} % of its "
        f"limit ({torque.joint}); {timing.real_time_factor:.1f} x real time",
        highlight=False,
    )
    console.print(f"recording: {out / (report.recording or '')}", highlight=False, soft_wrap=True)
