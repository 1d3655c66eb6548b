"""The commands that ask why and how much: ``fulcrum explain`` and ``fulcrum capacity``."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands.common import (
    FAILED,
    INTERRUPTED,
    PASSED,
    Chosen,
    check_json,
    chosen_control,
    progress_bar,
)

if TYPE_CHECKING:
    from rich.console import Console

    from fulcrum.sim.analysis.capacity import Capacity
    from fulcrum.sim.analysis.explain import Explanation, Optimum
    from fulcrum.sim.run.trial import Trial
    from fulcrum.synthesis.analysis.conflict import Conflict

# Shares of the capacity that `--confirm` runs: the first is to pass, the second to fail.
_CONFIRMED_SHARES = (0.95, 1.05)
# How many of the constraints that stop a change are named in a table.
_NAMED = 4
# Steps of the tilt at which it is said how much uncertainty a grip bears [deg].
_BORNE_DEG = 15.0
# Relative slopes by the centre of mass below this are not shown [1/m]: 0.001 % per mm.
_VISIBLE_PER_M = 0.01


@dataclass(frozen=True)
class ExplainCommand(Chosen):
    """Say why a scenario's problem has no solution and what would help, or how much it bears."""

    controller: str = "margin"
    """Whose margins count: robust, margin, paper or no-feedforward."""

    tilt_deg: float | None = None
    """Tilt [deg]; the first infeasible or else tightest one if left out."""

    objective: str | None = None
    """What the synthesis minimises (see `fulcrum list`); the scenario's own if left out."""

    json: Path | None = None
    """File for the result as JSON."""

    def execute(self) -> int:
        """Does it; returns the exit code: 0 feasible, 1 infeasible."""
        from rich.console import Console

        from fulcrum.sim.analysis.explain import explain, tightest_tilt
        from fulcrum.sim.planning.path_problems import PathProblems
        from fulcrum.sim.planning.robust_grip import borne
        from fulcrum.sim.run.files import write_json
        from fulcrum.synthesis import Synthesizer

        check_json(self.json)
        chosen = self.chosen()
        control = chosen_control(chosen, self.controller, self.objective)
        problems, synthesizer = PathProblems(chosen, control), Synthesizer()
        tilt = self.tilt_deg
        if tilt is None:
            tilt = tightest_tilt(problems, synthesizer)
        explanation = explain(problems, tilt, synthesizer)
        print_explanation(Console(highlight=False), explanation, self.controller)
        content = dataclasses.asdict(explanation)
        if explanation.feasible and control.robustness is not None:
            scalings = borne(chosen, control, _BORNE_DEG, problems.joint_path)
            bears = {tilt: scaling.factor for tilt, scaling in scalings.items()}
            _print_borne(Console(highlight=False), bears)
            content["uncertainty_borne"] = bears
        if self.json is not None:
            write_json(self.json, {"controller": self.controller, **content})
        return PASSED if explanation.feasible else FAILED


@dataclass(frozen=True)
class CapacityCommand(Chosen):
    """Find the heaviest object that the robot can pivot over the whole path, and can lift."""

    controller: str = "margin"
    """Whose margins count: margin, paper or no-feedforward."""

    confirm: bool = False
    """Run the closed loop with 95 % and with 105 % of the capacity."""

    json: Path | None = None
    """File for the result as JSON."""

    def execute(self) -> int:
        """Does it; returns the exit code: 1 if a run does not confirm what was found."""
        from rich.console import Console

        from fulcrum.sim.analysis.capacity import capacities
        from fulcrum.sim.evaluation.report import Verdict
        from fulcrum.sim.run.files import write_json
        from fulcrum.sim.run.trial import confirm

        check_json(self.json)
        chosen = self.chosen()
        control = chosen_control(chosen, self.controller, None)
        console = Console(highlight=False)
        with progress_bar(chosen.name) as progress:
            found = capacities(chosen, control, progress)
        for capacity in found:
            _print_capacity(console, capacity)
        trials = []
        # The scenario's own manoeuvre comes first.
        own = found[0]
        if self.confirm and 0.0 < own.weight < math.inf:
            for share in _CONFIRMED_SHARES:
                with progress_bar(f"{100 * share:.0f} % of {own.weight:.4g} N") as progress:
                    trial = confirm(chosen, self.controller, control, own.weight, share, progress)
                if trial.verdict is Verdict.INTERRUPTED:
                    return INTERRUPTED
                trials.append(trial)
                _print_trial(console, trial)
        if self.json is not None:
            content = {
                "scenario": chosen.name,
                "controller": self.controller,
                "capacities": [dataclasses.asdict(capacity) for capacity in found],
                "trials": [dataclasses.asdict(trial) for trial in trials],
            }
            write_json(self.json, content)
        confirmed = all((t.verdict is Verdict.PASS) is (t.share < 1.0) for t in trials)
        return PASSED if confirmed else FAILED


def _print_borne(console: Console, bears: dict[float, float]) -> None:
    """Prints the largest scaling of the controller's uncertainty set that one grip bears."""
    from rich.box import SIMPLE
    from rich.table import Table

    table = Table("tilt deg", "of the uncertainty set one grip bears", box=SIMPLE)
    for tilt, factor in bears.items():
        table.add_row(f"{tilt:g}", f"{100 * factor:.0f} %")
    console.print(table)


def print_explanation(console: Console, explanation: Explanation, controller: str) -> None:
    """Prints an explanation as sentences and tables."""
    verdict = "[bold green]FEASIBLE[/]" if explanation.feasible else "[bold red]INFEASIBLE[/]"
    console.print(
        f"{explanation.scenario} at {explanation.tilt_deg:g} deg, {explanation.weight:.4g} N, "
        f"controller {controller}, objective {explanation.objective}: {verdict}"
    )
    if explanation.conflict is not None:
        console.print(f"\n{explanation.conflict.sentence[0].upper()}", end="")
        console.print(f"{explanation.conflict.sentence[1:]}.", soft_wrap=True)
        _print_conflict(console, explanation.conflict, explanation.gains)
    if explanation.optimum is not None:
        _print_optimum(console, explanation.optimum)
    from rich.box import SIMPLE
    from rich.table import Table

    title = "how far each alone may go" if explanation.feasible else "what alone would help"
    table = Table("change", title, "in the way", box=SIMPLE)
    for kind, remedy in explanation.changes.items():
        blocked = remedy.conflict
        names = [] if blocked is None else list(blocked.limits or blocked.balances)
        table.add_row(kind, remedy.text, ", ".join(names[:_NAMED]))
    console.print(table)


def _print_conflict(console: Console, conflict: Conflict, gains: dict[str, float]) -> None:
    from rich.box import SIMPLE
    from rich.markup import escape
    from rich.table import Table

    from fulcrum.sim.analysis.explain import RELAXED

    alone = f"alone {100 * RELAXED:.0f} % better"
    table = Table("conflict", "share", "can give", alone, box=SIMPLE)
    units = ("", "[%]", "[% of asked]", "[% more weight]")
    table.add_row(*map(escape, units), style="dim")
    for name, share in conflict.balances.items():
        table.add_row(name, f"{100 * share:.2f}")
    table.add_section()
    for name, share in conflict.limits.items():
        given = conflict.given.get(name)
        gain = gains.get(name)
        table.add_row(
            name,
            f"{100 * share:.2f}",
            "" if given is None else f"{100 * given:.2f}",
            "" if gain is None else f"{100 * gain:+.2f}",
        )
    console.print(table)


def _print_optimum(console: Console, optimum: Optimum) -> None:
    from rich.box import SIMPLE
    from rich.markup import escape
    from rich.table import Table

    unit = "" if optimum.unit == "-" else f" {optimum.unit}"
    forces = ", ".join(f"{name} {f:.3f} N" for name, f in optimum.normal_forces.items())
    console.print(f"objective {optimum.value:.5g}{unit}; normal forces: {forces}", soft_wrap=True)
    console.print(f"at their limits: {', '.join(optimum.active) or 'none'}", soft_wrap=True)
    table = Table("sensitivity", "value", "slope", "per 1 %", box=SIMPLE)
    table.add_row("", "", escape(f"[{optimum.unit} per unit]"), escape("[%]"), style="dim")
    for name, influence in optimum.influences.items():
        value = f"{influence.value:.4g}" + ("" if influence.unit == "-" else f" {influence.unit}")
        table.add_row(name, value, f"{influence.slope:+.4g}", f"{influence.per_percent:+.3f}")
    for axis, slope in zip("xyz", optimum.sensitivities.center_of_mass, strict=True):
        if abs(slope) > _VISIBLE_PER_M * abs(optimum.value):
            share = 1e-3 * slope / optimum.value if optimum.value else 0.0
            table.add_row(
                f"centre of mass along {axis}",
                "per m",
                f"{slope:+.4g}",
                f"{100 * share:+.2f} per mm",
            )
    console.print(table)


def _print_capacity(console: Console, capacity: Capacity) -> None:
    if capacity.weight == math.inf:
        console.print(f"{capacity.manoeuvre}: any weight; nothing limits the grip")
        return
    curve = dict(zip(capacity.tilts_deg, capacity.weights, strict=True))
    end = max(curve)
    console.print(
        f"[bold]{capacity.manoeuvre}[/]: {capacity.weight:.4g} N ({capacity.mass:.4g} kg), limited "
        f"at {capacity.tilt_deg:.4g} deg; {curve[0.0]:.4g} N at 0 deg, {curve[end]:.4g} N at "
        f"{end:g} deg, {max(curve.values()):.4g} N at best",
        soft_wrap=True,
    )
    if capacity.lightest > 0.0:
        console.print(f"  at least {capacity.lightest:.4g} N, as the preloads ask")
    if capacity.conflict is not None:
        console.print(f"  there {', '.join(capacity.conflict.limits)}", end=" ", soft_wrap=True)
        console.print(f"against {', '.join(capacity.conflict.balances)}", soft_wrap=True)
    if capacity.weight > 0.0 and math.isfinite(capacity.confirmed_within):
        console.print(
            "  feasible just below and infeasible just above, when solved again "
            f"{capacity.confirmed_within:.0e} to either side"
        )
    elif capacity.weight > 0.0:
        console.print("  not confirmed by solving again to either side")


def _print_trial(console: Console, trial: Trial) -> None:
    color = "green" if trial.verdict == "pass" else "red"
    console.print(
        f"{100 * trial.share:.0f} % ({trial.weight:.4g} N) in closed loop: "
        f"[bold {color}]{trial.verdict.upper()}[/]; {trial.failed_syntheses} of {trial.syntheses} "
        f"syntheses without solution, torque at most {100 * trial.torque_utilisation:.1f} % "
        f"({trial.joint}), cut {100 * trial.saturated_fraction:.1f} % of the time, tilt error "
        f"{trial.tilt_error_deg:.3f} deg, slip {trial.slip_mm:.3f} mm",
        soft_wrap=True,
    )
    for failure in trial.failures[:3]:
        console.print(f"  - {failure}", soft_wrap=True)
