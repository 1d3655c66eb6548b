"""`fulcrum list`: the scenarios that ship."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.scenarios.commands.common import (
    PASSED,
)


@dataclass(frozen=True)
class ListCommand:
    """List the scenarios, and the controllers and objectives to run them with."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from rich.console import Console
        from rich.table import Table

        from fulcrum.scenarios.reading.library import scenarios
        from fulcrum.sim.scenario.control import Control, controllers
        from fulcrum.synthesis.problem import Objective

        table = Table("scenario", "what happens")
        for scenario in scenarios().values():
            table.add_row(scenario.name, scenario.summary)
        console = Console()
        console.print(table)
        console.print(f"controllers: {', '.join(controllers(Control()))}")
        console.print(f"objectives:  {', '.join(Objective)}")
        return PASSED
