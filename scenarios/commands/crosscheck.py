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
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import Bullets, Marked, Page, page, table

if TYPE_CHECKING:
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
        agrees = True
        with progress_bar(chosen.name) as move:
            checks = crosscheck(request, self._worlds(), progress=move)
            for i, check in enumerate(checks):
                show(_page(check))
                draw_crosscheck(f"{chosen.name}, {name}", check, out / f"crosscheck-{i}.png")
                agrees &= check.agrees
        show(page(f"Figures: {out}"))
        return PASSED if agrees else FAILED

    def _static(self, request: Request) -> int:
        from fulcrum.sim.analysis import static_differences
        from fulcrum.sim.run import Bounds
        from fulcrum.sim.run.execute import execute

        result = execute(request)
        found = static_differences(request.scenario, result.trace, result.history)
        rows, agrees = [], True
        for name, off in found.items():
            share = off.normal_rms_n / off.peak_n if off.peak_n > 0.0 else 0.0
            agrees &= share <= Bounds().hand and off.solved == 1.0
            figures = (off.normal_rms_n, 100 * share, off.tangential_rms_n)
            rows.append(
                (name, *(f"{x:.4f}" for x in figures), f"{100 * off.determined:.0f}"),
            )
        head = ("contact", "normal [N]", "normal [% of peak]", "tangential [N]", "determined [%]")
        title = f"{request.scenario.name}: Pinocchio's hard contacts minus MuJoCo's, RMS"
        show(page(title, table(head, rows)))
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


def _page(check: Crosscheck) -> Page:
    """How the variants of one world went, and how each contact differs from the reference."""
    runs = [
        (
            c.variant.name,
            c.result.report.verdict,
            c.result.report.outcome,
            f"{c.result.report.tilt.final_deg:z.3f}",
            f"{c.result.report.tilt.max_error_deg:.3f}",
            f"{c.result.report.timing.real_time_factor:.2f}",
        )
        for c in check.comparisons
    ]
    contacts = [
        (
            name,
            c.variant.name,
            f"{100 * d.normal_share:.2f}",
            f"{d.tangential_rms_n:.2f}",
            f"{d.slip_mm:.3f}",
        )
        for name in check.comparisons[0].contacts
        for c in check.comparisons
        for d in (c.contacts[name],)
    ]
    head = ("simulated by", "verdict", "outcome", "final tilt [deg]", "tilt error [deg]")
    said = [f"{c.variant.name}: {text}" for c in check.comparisons for text in c.disagreements]
    return page(
        Marked(check.label),
        table((*head, "x real time"), runs),
        table(
            ("contact", "simulated by", "normal [% of peak]", "tangential [N]", "slip [mm]"),
            contacts,
        ),
        Bullets(tuple(said)),
    )
