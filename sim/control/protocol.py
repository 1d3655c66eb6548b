"""The interface between a controller and the loop."""

from __future__ import annotations

from typing import Protocol

from fulcrum.sim.model import RobotModel
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Command, Event, Measurement


class Controller(Protocol):
    """A controller: torques from measurements, one run at a time."""

    @property
    def events(self) -> tuple[Event, ...]:
        """What went wrong since the reset, and the reactions to it."""

    def reset(self, scenario: Scenario, robot: RobotModel, seed: int) -> None:
        """Begin a run.

        Args:
            scenario: Scenario as the controller believes it to be.
            robot: Model of the robots.
            seed: Seed of the controller's random numbers.
        """

    def command(self, measurement: Measurement) -> Command:
        """Return the torques of the next step; called once per physics step."""

    def left_s(self, t: float) -> float:
        """Return the expected time to the end of the run at a time [s]; 0 at the end."""
