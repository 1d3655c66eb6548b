"""The command line: ``fulcrum``."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.check import Check
from scenarios.commands import Capacity, Explain
from scenarios.common import (
    BAD_INPUT,
    FAILED,
    INTERRUPTED,
    PASSED,
    Chosen,
    chosen_control,
    chosen_planning,
    progress_bar,
    results_folder,
)
from scenarios.new import New
from scenarios.paper.command import Reproduce
from scenarios.place import Place
from scenarios.planning import Plan
from scenarios.sweep import Sweep

if TYPE_CHECKING:
    from sim.preparation import Preparation
    from sim.report import Report
    from sim.run import Request

# Heavy packages are imported by the commands that need them: `fulcrum --help` answers at once.


@dataclass(frozen=True)
class List:
    """List the scenarios, and the controllers and objectives to run them with."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from rich.console import Console
        from rich.table import Table

        from scenarios import scenarios
        from sim.settings import Control, controllers
        from synthesis.problem import Objective

        table = Table("scenario", "what happens")
        for scenario in scenarios().values():
            table.add_row(scenario.name, scenario.summary)
        console = Console()
        console.print(table)
        console.print(f"controllers: {', '.join(controllers(Control()))}")
        console.print(f"objectives:  {', '.join(Objective)}")
        return PASSED


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

    out: Path | None = None
    """New or empty folder for the results; logs/SCENARIO-CONTROLLER-TIME if left out."""

    live: bool = False
    """Open a viewer that follows the run."""

    anyway: bool = False
    """Run with forces as near to balance as the limits allow where none balance the object."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from rich.console import Console

        from scenarios.commands import print_explanation
        from scenarios.sweep import print_outcome
        from sim.plan import PlanError
        from sim.preparation import UnholdableError
        from sim.report import Verdict
        from sim.run import execute as run

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
        from scenarios.sweep import drawn_world
        from sim.execution import planned_tilt
        from sim.preparation import Preparation
        from sim.run import Request
        from sim.settings import default_controller, stretched
        from synthesis.errors import InvalidInputError

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
        return request, prepared


@dataclass(frozen=True)
class Screenshot:
    """Draw a moment of a recording as a picture, without a screen."""

    run: tyro.conf.Positional[Path]
    """Folder of a run, or an .rrd file."""

    at: float
    """Moment [s]."""

    out: Path | None = None
    """PNG to write; RUN/screenshot-AT.png if left out."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from sim.recording import recording_file, screenshot
        from synthesis.errors import InvalidInputError

        picture = self.out or recording_file(self.run).parent / f"screenshot-{self.at:g}.png"
        if not picture.parent.is_dir():
            raise InvalidInputError("--out", str(picture), "a file in a folder that exists")
        screenshot(self.run, self.at, picture)
        print(picture)
        return PASSED


@dataclass(frozen=True)
class View:
    """Open a recording in the Rerun viewer."""

    run: tyro.conf.Positional[Path]
    """Folder of a run, or an .rrd file."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from sim.recording import view

        view(self.run)
        return PASSED


Command = (
    Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Screenshot, tyro.conf.subcommand("screenshot")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Explain, tyro.conf.subcommand("explain")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[New, tyro.conf.subcommand("new")]
    | Annotated[Capacity, tyro.conf.subcommand("capacity")]
    | Annotated[Place, tyro.conf.subcommand("place")]
    | Annotated[Plan, tyro.conf.subcommand("plan")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit code.

    0 pass, 1 failed its checks, 2 bad input, 130 interrupted.
    """
    command = None
    try:
        command = _parse(arguments)
        return command.execute()
    except KeyboardInterrupt:  # a run that has begun catches it itself
        print("fulcrum: interrupted.", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        from synthesis.errors import FulcrumError

        if not isinstance(error, (FulcrumError, OSError)):
            raise
        text = command.told(error) if isinstance(command, Chosen) else str(error)
        print(f"fulcrum: {' '.join(text.split())}", file=sys.stderr)
        return BAD_INPUT


def _parse(
    arguments: Sequence[str] | None,
) -> (
    List
    | Run
    | Screenshot
    | View
    | Explain
    | Check
    | New
    | Capacity
    | Place
    | Plan
    | Reproduce
    | Sweep
):
    """The command asked for; a parse error leaves as one line instead of tyro's box."""
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            return tyro.cli(Command, prog="fulcrum", description=_DESCRIPTION, args=arguments)
    except SystemExit as stop:
        if stop.code == 0:
            raise
        from synthesis.errors import InvalidInputError

        boxed = re.split(r"─{5,}", errors.getvalue())
        words = re.sub(r"[│╭╮╰╯─\s]+", " ", boxed[1] if len(boxed) > 1 else errors.getvalue())
        raise InvalidInputError("command line", words.strip(), "as `fulcrum --help` says") from None


_DESCRIPTION = (
    "Robots move objects too heavy to lift by leaning them on their surroundings: contact force "
    "synthesis in a MuJoCo closed loop, recorded and checked."
)


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


if __name__ == "__main__":
    sys.exit(main())
