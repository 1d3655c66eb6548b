"""`fulcrum crosscheck`: the same runs in two engines and at half the step, compared."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands.common import (
    FAILED,
    PASSED,
    Chosen,
    chosen_control,
    progress_bar,
    results_folder,
)

if TYPE_CHECKING:
    from rich.console import Console

    from fulcrum.sim.run import Crosscheck, Request
    from fulcrum.sim.world import World


@dataclass(frozen=True)
class CrosscheckCommand(Chosen):
    """Run a scenario in MuJoCo and in Drake, and at half the step; exit 1 where they disagree."""

    controller: str | None = None
    """See `fulcrum list`; robust if left out."""

    preset: str = "lab"
    """How far worlds may be from what is believed: nominal, lab, field or harsh."""

    episodes: int = 0
    """Worlds drawn from the preset, besides the nominal one."""

    seed: int = 0
    """Of the first world; the next have the next."""

    static: bool = False
    """Compare the forces of MuJoCo's run with Pinocchio's hard contacts instead."""

    out: Path | None = None
    """New or empty folder for the figures; logs/crosscheck-SCENARIO-TIME if left out."""

    def execute(self) -> int:
        """Do it; return the exit code."""
        from rich.console import Console

        from fulcrum.sim.run import Request
        from fulcrum.sim.run.crosscheck import crosscheck
        from fulcrum.sim.run.crosscheck_picture import draw_crosscheck
        from fulcrum.sim.scenario import default_controller

        chosen = self.chosen()
        name = self.controller or default_controller(False)
        control = chosen_control(chosen, name, None)
        request = Request(chosen, name, control, best_effort=True)
        if self.static:
            return self._static(request)
        out = results_folder(self.out, f"crosscheck-{chosen.name}")
        out.mkdir(parents=True, exist_ok=True)
        agrees, console = True, Console(highlight=False)
        with progress_bar(chosen.name) as move:
            checks = crosscheck(request, self._worlds(), progress=move)
            for i, check in enumerate(checks):
                _print(console, check)
                draw_crosscheck(f"{chosen.name}, {name}", check, out / f"crosscheck-{i}.png")
                agrees &= check.agrees
        console.print(f"figures: {out}", soft_wrap=True)
        return PASSED if agrees else FAILED

    def _static(self, request: Request) -> int:
        from rich.box import SIMPLE
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        from fulcrum.sim.analysis import static_differences
        from fulcrum.sim.run import Bounds
        from fulcrum.sim.run.execute import execute

        result = execute(request)
        found = static_differences(request.scenario, result.trace, result.history)
        table = Table("contact", "normal", "normal", "tangential", "determined", box=SIMPLE)
        table.add_row(*map(escape, ("", "[N]", "[% of peak]", "[N]", "[%]")), style="dim")
        agrees = True
        for name, off in found.items():
            share = off.normal_rms_n / off.peak_n if off.peak_n > 0.0 else 0.0
            agrees &= share <= Bounds().hand and off.solved == 1.0
            table.add_row(
                name,
                f"{off.normal_rms_n:.4f}",
                f"{100 * share:.3f}",
                f"{off.tangential_rms_n:.4f}",
                f"{100 * off.determined:.0f}",
            )
        console = Console(highlight=False)
        console.print(f"{request.scenario.name}: hard contacts minus MuJoCo, RMS where determined")
        console.print(table)
        return PASSED if agrees else FAILED

    def _worlds(self) -> dict[str, tuple[World, int]]:
        """The nominal world and those drawn, with the seed of each, by what to call them."""
        from fulcrum.scenarios.commands.sweep import drawn_world
        from fulcrum.sim.world import NO_DEVIATION
        from fulcrum.synthesis import InvalidInputError

        for option in ("episodes", "seed"):
            if getattr(self, option) < 0:
                valid = "an integer >= 0"
                raise InvalidInputError(f"--{option}", getattr(self, option), valid)
        worlds = {"nominal": (NO_DEVIATION, self.seed)}
        for seed in range(self.seed, self.seed + self.episodes):
            label = f"{self.preset}, seed {seed}"
            worlds[label] = drawn_world(self.chosen(), self.preset, seed, ""), seed
        return worlds


def _print(console: Console, check: Crosscheck) -> None:
    from rich.box import SIMPLE
    from rich.markup import escape
    from rich.table import Table

    names = list(check.comparisons[0].contacts)
    table = Table("", "verdict", "tilt", "error", "real time", box=SIMPLE, title=check.label)
    for name in names:
        table.add_column(f"{name}: normal, tangential, slip")
    units = ["", "", "[deg]", "[deg]", "[x]", *("[% of peak], [N], [mm]" for _ in names)]
    table.add_row(*map(escape, units), style="dim")
    for comparison in check.comparisons:
        report = comparison.result.report
        table.add_row(
            comparison.variant.name,
            report.verdict,
            f"{report.tilt.final_deg:z.3f}",
            f"{report.tilt.max_error_deg:.3f}",
            f"{report.timing.real_time_factor:.2f}",
            *(
                f"{100 * c.normal_share:.2f}, {c.tangential_rms_n:.2f}, {c.slip_mm:.3f}"
                for c in comparison.contacts.values()
            ),
        )
    console.print(table)
    for comparison in check.comparisons:
        for text in comparison.disagreements:
            console.print(f"  {comparison.variant.name}: {text}")
