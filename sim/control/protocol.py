"""What a controller is to the loop."""

from __future__ import annotations

from typing import Protocol

from fulcrum.sim.model import RobotModel
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Command, Event, Measurement


class Controller(Protocol):
    """Turns measurements into torques, one run at a time."""

    @property
    def events(self) -> tuple[Event, ...]:
        """What went wrong since the reset, and what was done about it."""

    def reset(self, scenario: Scenario, robot: RobotModel, seed: int) -> None:
        """Begin a run.

        Args:
            scenario: What the controller believes.
            robot: Its model of the robots.
            seed: Of whatever is random in the controller.
        """

    def command(self, measurement: Measurement) -> Command:
        """Return the torques of the next step; called once per physics step."""

    def left_s(self, t: float) -> float:
        """Return how long the run still takes as things stand at a time [s]; 0 at its end."""
