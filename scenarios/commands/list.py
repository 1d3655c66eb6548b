"""`fulcrum list`: the scenarios that ship."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.scenarios.commands.common import PASSED
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis import Objective
from fulcrum.synthesis.render import Lines, page, table


@dataclass(frozen=True)
class ListCommand:
    """List the scenarios that ship, the controllers and the objectives."""

    def execute(self) -> int:
        """Run the command; return the exit code."""
        from fulcrum.scenarios.reading.library import scenarios
        from fulcrum.sim.scenario import Control, controllers

        rows = [(scenario.name, scenario.summary) for scenario in scenarios().values()]
        names = (
            f"controllers: {', '.join(controllers(Control()))}",
            f"objectives:  {', '.join(Objective)}",
        )
        show(page(table(("scenario", "description"), rows), Lines(names)))
        return PASSED
