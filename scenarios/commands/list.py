"""`fulcrum list`: the scenarios that ship."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.scenarios.commands.common import (
    PASSED,
)
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import Lines, page, table


@dataclass(frozen=True)
class ListCommand:
    """List the scenarios, and the controllers and objectives to run them with."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from fulcrum.scenarios.reading.library import scenarios
        from fulcrum.sim.scenario import Control, controllers
        from fulcrum.synthesis import Objective

        rows = [(scenario.name, scenario.summary) for scenario in scenarios().values()]
        names = (
            f"controllers: {', '.join(controllers(Control()))}",
            f"objectives:  {', '.join(Objective)}",
        )
        show(page(table(("scenario", "what happens"), rows), Lines(names)))
        return PASSED
