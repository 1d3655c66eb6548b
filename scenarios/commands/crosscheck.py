"""`fulcrum crosscheck`: the same runs in two engines and at half the step, compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.checks import whole
from fulcrum.synthesis.render import Bullets, Marked, Page, page, table

if TYPE_CHECKING:
    from fulcrum.sim.run import Crosscheck, Request
    from fulcrum.sim.scenario import Scenario
    from fulcrum.sim.world import World


@dataclass(frozen=True)
class CrosscheckCommand(common.Chosen):
    """Run a scenario in MuJoCo and in Drake, and at half the time step; compare the runs."""

    controller: str = "robust"
    """Controller of all runs (see `fulcrum list`)."""

    preset: str = "lab"
    """How far simulated worlds may be off the model: nominal, lab, field or harsh."""

    episodes: int = 0
    """Number of worlds to draw from the preset, besides the nominal one."""

    seed: int = 0
    """Seed of the first world; the next ones have the next seeds."""

    static: bool = False
    """Compare the forces of MuJoCo's run with Pinocchio's hard contacts instead."""

    out: common.MaybePath = None
    """New or empty folder for the figures; by default logs/crosscheck-SCENARIO-TIME."""

    def execute(self) -> int:
        """Run the command; return the exit code: 1 if the engines disagree."""
        from fulcrum.scenarios.functions import chosen_control
        from fulcrum.sim.run import Request
        from fulcrum.sim.run.crosscheck import crosscheck
        from fulcrum.sim.run.crosscheck_picture import draw_crosscheck

        chosen = self.chosen()
        control = chosen_control(chosen, self.controller)
        request = Request(chosen, self.controller, control, best_effort=True)
        if self.static:
            return self._static(request)
        worlds = self._worlds(chosen)
        out = common.results_folder(self.out, f"crosscheck-{chosen.name}")
        agrees = True
        with common.progress_bar(chosen.name) as move:
            for i, check in enumerate(crosscheck(request, worlds, progress=move)):
                show(_page(check))
                title = f"{chosen.name}, {self.controller}"
                draw_crosscheck(title, check, out / f"crosscheck-{i}.png")
                agrees &= check.agrees
        show(page(f"Figures: {out}"))
        return common.PASSED if agrees else common.FAILED

    def _static(self, request: Request) -> int:
        from fulcrum.sim.analysis import static_differences
        from fulcrum.sim.run import Bounds
        from fulcrum.sim.run.execute import execute

        result = execute(request)
        rows, agrees = [], True
        found = static_differences(request.scenario, result.trace, result.history)
        for name, off in found.items():
            share = off.normal_rms_n / off.peak_n if off.peak_n > 0.0 else 0.0
            agrees &= share <= Bounds().hand and off.solved == 1.0
            normal, tangential = f"{off.normal_rms_n:.4f}", f"{off.tangential_rms_n:.4f}"
            determined = f"{100 * off.determined:.0f}"
            rows.append((name, normal, f"{100 * share:.3f}", tangential, determined))
        head = ("contact", "normal [N]", "normal [% of peak]", "tangential [N]", "determined [%]")
        title = "RMS difference of hard contacts and MuJoCo, where the forces are determined"
        show(page(f"{request.scenario.name}: {title}", table(head, rows)))
        return common.PASSED if agrees else common.FAILED

    def _worlds(self, chosen: Scenario) -> dict[str, tuple[World, int]]:
        """Return the nominal world and those drawn, each with its seed, by name."""
        from fulcrum.scenarios.functions import drawn_world
        from fulcrum.sim.world import NO_DEVIATION

        whole("--episodes", self.episodes, least=0)
        whole("--seed", self.seed, least=0)
        worlds = {"nominal": (NO_DEVIATION, self.seed)}
        for seed in range(self.seed, self.seed + self.episodes):
            worlds[f"{self.preset}, seed {seed}"] = drawn_world(chosen, self.preset, seed, {}), seed
        return worlds


def _page(check: Crosscheck) -> Page:
    """Return the runs of one world, and how each contact differs from the reference, as a page."""
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
