"""The design of a sweep: its episodes, and the command that replays each of them."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from fulcrum.sim.planning import Planning
from fulcrum.sim.run import PACKAGES, finite
from fulcrum.sim.scenario import Scenario, controllers
from fulcrum.sim.world import ParameterGrid, World, draw, overridden, preset
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import whole

# Largest number of episodes: more take days, and each needs a task in memory.
_MOST = 100_000


@dataclass(frozen=True)
class Episode:
    """An episode: one controller in one world.

    Attributes:
        number: Number of the world within the sweep; all controllers run in the same worlds.
        controller: Name of the controller.
        seed: Seed of world and start posture.
        values: Values of the world's parameters that the grid sets, by parameter.
    """

    number: int
    controller: str
    seed: int
    values: tuple[tuple[str, float], ...] = ()

    @property
    def name(self) -> str:
        """Name, unique in the sweep and valid as the name of a file."""
        return f"{self.number:07d}-{self.controller}"


@dataclass(frozen=True)
class Sweep:
    """A sweep: every controller in every world, judged by the tolerances for disturbed runs.

    Attributes:
        scenario: Scenario that the controllers assume.
        controllers: Names of the controllers.
        preset: Name of the uncertainty from which worlds are drawn.
        episodes: Number of episodes for each controller and point of the grid.
        seed: Seed of the first episode; the next ones have the following numbers.
        grid: Parameters of the drawn worlds that are set, with their values.
        planning: How the tilt is planned, if the scenario is that of a planned tilt; else None.
        called: Name of the scenario on command lines; its own name if empty.
    """

    scenario: Scenario
    controllers: tuple[str, ...]
    preset: str
    episodes: int
    seed: int = 0
    grid: ParameterGrid = ()
    planning: Planning | None = None
    called: str = ""

    def __post_init__(self) -> None:
        known = controllers(self.scenario.control)
        valid = f"one or more of {', '.join(known)}, each once"
        once = len(set(self.controllers)) == len(self.controllers)
        if not (self.controllers and once and set(self.controllers) <= set(known)):
            raise InvalidInputError("controllers", ",".join(self.controllers), valid)
        whole("episodes", self.episodes, least=1)
        whole("seed", self.seed, least=0)
        worlds = self.episodes * math.prod(len(values) for _, values in self.grid)
        if worlds * len(self.controllers) > _MOST:
            valid = f"at most {_MOST} in all, over grid and controllers"
            raise InvalidInputError("episodes", self.episodes, valid)
        drawn = draw(preset(self.preset), self.scenario, self.seed)
        for name, values in self.grid:
            for value in values:
                overridden(drawn, self.scenario, {name: value}).truth(self.scenario)

    def all_episodes(self) -> list[Episode]:
        """Return every episode, world after world, so that early results compare controllers."""
        points = [[(name, value) for value in values] for name, values in self.grid]
        worlds = itertools.product(range(self.episodes), itertools.product(*points))
        return [
            Episode(number, controller, self.seed + i, values)
            for number, (i, values) in enumerate(worlds)
            for controller in self.controllers
        ]

    def world(self, episode: Episode) -> World:
        """Return the true world of an episode."""
        drawn = draw(preset(self.preset), self.scenario, episode.seed)
        return overridden(drawn, self.scenario, dict(episode.values))

    def replay(self, episode: Episode) -> str:
        """Return the command that runs an episode again, with a recording."""
        words = [
            f"fulcrum run {self.called or self.scenario.name} --controller {episode.controller}",
            f"--preset {self.preset} --seed {episode.seed}",
        ]
        if self.planning is not None:
            words.append(self.planning.options)
        if self.preset == "nominal" and not episode.values:
            words.append("--disturbed")
        if episode.values:
            words.append("--world " + ",".join(f"{n}={v!r}" for n, v in episode.values))
        return " ".join(words)

    def config(self) -> dict[str, Any]:
        """Return everything that determines the episodes, for JSON."""
        known = controllers(self.scenario.control)
        return finite(
            {
                "scenario": dataclasses.asdict(self.scenario),
                "controllers": {n: dataclasses.asdict(known[n]) for n in self.controllers},
                "preset": self.preset,
                "uncertainty": dataclasses.asdict(preset(self.preset)),
                "episodes": self.episodes,
                "seed": self.seed,
                "grid": {name: list(values) for name, values in self.grid},
                "planning": None if self.planning is None else dataclasses.asdict(self.planning),
                "versions": {name: version(name) for name in PACKAGES},
            }
        )
