"""`fulcrum sweep`: controllers in many worlds."""

from __future__ import annotations

import dataclasses
import shlex
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import refuse, show
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.sim.sweep import Sweep


@dataclass(frozen=True)
class SweepCommand(common.Planned):
    """Run a scenario in many worlds: success rates, causes of failure, success map, replays."""

    episodes: int
    """Number of worlds; with --grid, at each point of the grid."""

    preset: str = "field"
    """How far simulated worlds may be off the model: nominal, lab, field or harsh."""

    controllers: common.MaybeText = None
    """Names with commas between; by default all with feed-forward that suit the tilt's speed."""

    grid: str = ""
    """Values to set in drawn worlds, as factors: friction=0.7:1.3:7 (7 steps),weight=0.8,1.2"""

    workers: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """Processes on this machine; by default one per processor."""

    scheduler: common.MaybeText = None
    """Address of a running Dask cluster to use instead, such as tcp://host:8786."""

    seed: int = 0
    """Seed of the first world; the next ones have the next seeds."""

    require: float = 0.0
    """Least success rate of every controller [%]; the exit code is 1 if one is lower."""

    map: common.MaybeText = None
    """Two parameters of the success map; by default those of the grid, or mass,hand_friction."""

    out: common.MaybePath = None
    """Folder for results, or to resume from; by default logs/sweep-SCENARIO-PRESET-TIME."""

    def execute(self) -> int:
        """Run the command; return the exit code."""
        from fulcrum.sim.planning import PlanError
        from fulcrum.sim.run import Workers, write_json
        from fulcrum.sim.sweep import MAP, SUMMARY, Store, run_sweep
        from fulcrum.sim.sweep.picture import draw_map

        if not 0.0 <= self.require <= 100.0:
            raise InvalidInputError("--require", self.require, "a share in [0, 100] %")
        workers = Workers(self.workers, self.scheduler)
        try:
            sweep = self._sweep()
        except PlanError as error:
            refuse(f"{error}")
            return common.FAILED
        pair = self._map(sweep)
        folder = self.out or common.results_folder(
            None, f"sweep-{sweep.scenario.name}-{self.preset}"
        )
        store = Store(sweep, folder)
        before, started = len(store.missing()), time.perf_counter()
        try:
            with common.removed_if_empty(folder), common.progress_bar(sweep.scenario.name) as move:

                def report(done: int, total: int, failures: int) -> None:
                    move(done, total, f"{done} of {total}, {failures} failed")

                swept = run_sweep(sweep, folder, workers, report)
        except KeyboardInterrupt:
            left = len(store.missing())
            print(
                f"fulcrum: interrupted; {len(sweep.all_episodes()) - left} episodes are kept, "
                f"{left} are left. Resume with: {self.line('sweep', out=store.folder)}",
                file=sys.stderr,
            )
            return common.INTERRUPTED
        minutes = (time.perf_counter() - started) / 60.0
        draw_map(swept.rows, sweep, pair, store.folder / MAP)
        summary = {
            "scenario": sweep.scenario.name,
            "preset": self.preset,
            "episodes": self.episodes,
            "seed": self.seed,
            "grid": {name: list(values) for name, values in sweep.grid},
            "tolerances": dataclasses.asdict(sweep.scenario.tolerances.disturbed),
            "controllers": {s.controller: dataclasses.asdict(s) for s in swept.scores},
            "map": list(pair),
        }
        pace = ""
        if before:  # else the time of an earlier call is in the file
            pace = f", {before / minutes:.0f} episodes per minute"
            summary["session"] = {
                "episodes": before,
                "minutes": minutes,
                "episodes_per_minute": before / minutes,
                "workers": self.workers,
                "scheduler": self.scheduler,
            }
        write_json(store.folder / SUMMARY, summary)
        each = f"{swept.scores[0].episodes} episodes per controller{pace}"
        show(swept.page() + page(each, f"Rows, figures and map: {store.folder}"))
        enough = all(100.0 * score.rate >= self.require for score in swept.scores)
        return common.PASSED if enough else common.FAILED

    def _sweep(self) -> Sweep:
        from fulcrum.scenarios.functions import sweep_design
        from fulcrum.sim.world import parse_grid

        chosen, names = self.chosen(), None
        if self.controllers is not None:
            names = tuple(name.strip() for name in self.controllers.split(","))
        return sweep_design(
            chosen,
            self.episodes,
            names,
            self.preset,
            self.seed,
            parse_grid("--grid", self.grid),
            self.planning(chosen),
            called=shlex.join(self.words),
        )

    def _map(self, sweep: Sweep) -> tuple[str, str]:
        from fulcrum.sim.world import parameter_name

        if self.map is None:
            names = [name for name, _ in sweep.grid]
            names += [name for name in ("mass", "hand_friction") if name not in names]
            return names[0], names[1]
        names = [parameter_name("--map", name) for name in self.map.split(",")]
        if len(set(names)) != 2 or len(names) != 2:
            raise InvalidInputError("--map", self.map, "two parameters, like mass,friction")
        return names[0], names[1]
