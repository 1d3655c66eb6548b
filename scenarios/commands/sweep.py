"""The command that measures controllers in many worlds: ``fulcrum sweep``."""

from __future__ import annotations

import dataclasses
import shlex
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands.common import (
    FAILED,
    INTERRUPTED,
    PASSED,
    Chosen,
    chosen_planning,
    progress_bar,
    removed_if_empty,
    results_folder,
)
from fulcrum.scenarios.commands.terminal import refuse, show
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.sim.scenario import Scenario
    from fulcrum.sim.sweep import Sweep
    from fulcrum.sim.world import World


@dataclass(frozen=True)
class SweepCommand(Chosen):
    """Run a scenario in many worlds: success rates, causes of failure, success map, replays."""

    episodes: int
    """How many worlds; with a grid, at each of its points."""

    preset: str = "field"
    """How far worlds are from what is believed: nominal, lab, field or harsh."""

    controllers: str | None = None
    """Names with commas between; all meet the same worlds. All with feed-forward if left out: with
    a plan those that count with inertia, else those that do not."""

    plan: str | None = None
    """least-time, least-effort or friction-margin: plan the tilt, and execute that in every
    world."""

    stretch: float = 1.0
    """By how much the planned duration is stretched."""

    robust: bool = False
    """The plan also serves the uncertainty set of controller robust, or as much as it can."""

    duration: float | None = None
    """The longest that a plan may take [s]; the scenario's own if left out."""

    grid: str = ""
    """What to set of every world drawn, like friction=0.7:1.3:7,weight=0.8,1.0,1.2 (factors)."""

    workers: int | None = None
    """Processes on this machine; one for each of its processors if left out."""

    scheduler: str | None = None
    """Address of a running Dask cluster instead, like tcp://host:8786."""

    seed: int = 0
    """Of the first world; the next have the next."""

    require: float = 0.0
    """Least success rate of every controller [%]; exit code 1 if one is lower."""

    map: str | None = None
    """The two parameters of the map, like mass,friction; the grid's, or mass,hand_friction."""

    out: Path | None = None
    """Folder for the results; a sweep that was broken off there is gone on with.
    logs/sweep-SCENARIO-PRESET-TIME if left out."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from fulcrum.sim.planning import PlanError
        from fulcrum.sim.run import Workers, write_json
        from fulcrum.sim.sweep import MAP, SUMMARY, Store, run_sweep
        from fulcrum.sim.sweep.picture import draw_map
        from fulcrum.synthesis import InvalidInputError

        if not 0.0 <= self.require <= 100.0:
            raise InvalidInputError("--require", self.require, "a share in [0, 100] %")
        workers = Workers(self.workers, self.scheduler)
        try:
            sweep = self._sweep()
        except PlanError as error:
            refuse(f"{error}")
            return FAILED
        pair = self._map(sweep)
        folder = self.out or results_folder(None, f"sweep-{sweep.scenario.name}-{self.preset}")
        store = Store(sweep, folder)
        before, started = len(store.missing()), time.perf_counter()
        try:
            with removed_if_empty(folder), progress_bar(sweep.scenario.name) as move:
                swept = run_sweep(
                    sweep,
                    folder,
                    workers,
                    lambda done, total, failures: move(
                        done, total, f"{done} of {total}, {failures} failed"
                    ),
                )
        except KeyboardInterrupt:
            left = len(store.missing())
            done = len(sweep.all_episodes()) - left
            print(
                f"fulcrum: interrupted; {done} episodes are kept, {left} are left. Go on with: "
                f"{self._again(store.folder)}",
                file=sys.stderr,
            )
            return INTERRUPTED
        minutes = (time.perf_counter() - started) / 60.0
        found = swept.scores
        draw_map(swept.rows, sweep, pair, store.folder / MAP)
        summary = {
            "scenario": sweep.scenario.name,
            "preset": self.preset,
            "episodes": self.episodes,
            "seed": self.seed,
            "grid": {name: list(values) for name, values in sweep.grid},
            "tolerances": dataclasses.asdict(sweep.scenario.tolerances.disturbed),
            "controllers": {score.controller: dataclasses.asdict(score) for score in found},
            "map": list(pair),
        }
        if before:  # else an earlier call's time stands there
            summary |= {
                "session": {
                    "episodes": before,
                    "minutes": minutes,
                    "episodes_per_minute": before / minutes,
                    "workers": self.workers,
                    "scheduler": self.scheduler,
                }
            }
        write_json(store.folder / SUMMARY, summary)
        pace = f", {before / minutes:.0f} episodes per minute" if before else ""
        show(
            swept.page()
            + page(
                f"{found[0].episodes} episodes each{pace}",
                f"Rows, figures and map: {store.folder}",
            )
        )
        return PASSED if all(100.0 * s.rate >= self.require for s in found) else FAILED

    def _sweep(self) -> Sweep:
        from fulcrum.sim.planning import planned_tilt
        from fulcrum.sim.scenario import comparable
        from fulcrum.sim.sweep import Sweep
        from fulcrum.sim.world import parse_grid

        chosen = self.chosen()
        asked = self.plan, self.stretch, self.duration, self.robust
        planning = chosen_planning(chosen, *asked)
        if planning is not None:
            chosen = planned_tilt(chosen, planning).scenario
        if self.controllers is None:
            names = comparable(chosen.control, planned=planning is not None)
        else:
            names = tuple(name.strip() for name in self.controllers.split(","))
        return Sweep(
            scenario=chosen,
            controllers=names,
            preset=self.preset,
            episodes=self.episodes,
            seed=self.seed,
            grid=parse_grid("--grid", self.grid),
            planning=planning,
            called=shlex.join(self.words),
        )

    def _map(self, sweep: Sweep) -> tuple[str, str]:
        from fulcrum.sim.world import parameter_name
        from fulcrum.synthesis import InvalidInputError

        if self.map is None:
            names = [name for name, _ in sweep.grid]
            names += [name for name in ("mass", "hand_friction") if name not in names]
            return names[0], names[1]
        names = [parameter_name("--map", name) for name in self.map.split(",")]
        if len(set(names)) != 2 or len(names) != 2:
            raise InvalidInputError("--map", self.map, "two parameters, like mass,friction")
        return names[0], names[1]

    def _again(self, folder: Path) -> str:
        """The command that goes on with this sweep."""
        words = ["fulcrum", "sweep", *self.words]
        for field in dataclasses.fields(self):
            value = folder if field.name == "out" else getattr(self, field.name)
            # No False: 0 is one to Python, and a seed.
            if field.name in ("scenario", "allow_path") or value in (None, "") or value is False:
                continue
            words += [f"--{field.name}"] if value is True else [f"--{field.name}", str(value)]
        return shlex.join(words)


def drawn_world(scenario: Scenario, preset: str, seed: int, values: str) -> World:
    """The world of a preset and seed, with some values set, as in a sweep's episode.

    Raises:
        InvalidInputError: There is no such preset, or the values are not of the form that it names.
    """
    from fulcrum.sim.world import overridden, parse_values
    from fulcrum.sim.world import presets as uncertainty

    drawn = uncertainty.draw(uncertainty.preset(preset), scenario, seed)
    return overridden(drawn, scenario, parse_values("--world", values))
