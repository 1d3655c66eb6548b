"""Engines that simulate the plant, by name."""

from __future__ import annotations

from enum import StrEnum
from importlib.util import find_spec

from fulcrum.sim.plant.protocol import Plant
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.world import World
from fulcrum.synthesis import InvalidInputError


class Engine(StrEnum):
    """Engine that simulates the plant."""

    MUJOCO = "mujoco"
    DRAKE = "drake"


def check_installed(engine: Engine) -> None:
    """Refuse an engine whose package is missing.

    Raises:
        InvalidInputError: The package is missing.
    """
    if engine is Engine.DRAKE and find_spec("pydrake") is None:
        raise InvalidInputError("engine", "drake, which is not installed", "pip install .[drake]")


def make_plant(engine: Engine, scenario: Scenario, world: World) -> Plant:
    """Return the plant of a true scenario and world in an engine.

    Raises:
        InvalidInputError: The engine is not installed, or the world does not fit the scenario.
    """
    check_installed(engine)
    if engine is Engine.DRAKE:
        from fulcrum.sim.plant.drake import DrakePlant

        return DrakePlant(scenario, world)
    from fulcrum.sim.plant.mujoco import MujocoPlant

    return MujocoPlant(scenario, world)
