"""The command that plans a tilt: ``fulcrum plan``."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from fulcrum.scenarios.commands.common import (
    FAILED,
    PASSED,
    Chosen,
    asked_planning,
    check_results_folder,
    results_folder,
)

if TYPE_CHECKING:
    from rich.console import Console

    from fulcrum.sim.planning.plan import Plan
    from fulcrum.sim.planning.problem import Margins
    from fulcrum.sim.scenario.scenario import Scenario

PLAN, PICTURE = "plan.json", "plan.png"
# Limits with less than this at their most used are not listed.
_LISTED = 0.5


@dataclass(frozen=True)
class PlanCommand(Chosen):
    """Plan the fastest, easiest or safest tilt, with the forces along it; draw and write it."""

    objective: str = "least-time"
    """least-time, least-effort or friction-margin."""

    duration: float | None = None
    """Longest duration [s]; for objectives other than least-time the scenario's own if left out."""

    points: int = 100
    """Grid points along the path."""

    friction_factor: float | None = None
    """Share of the friction that may be used; the scenario's own if left out."""

    limits: float = 0.9
    """Share of the torque and speed limits that may be used."""

    grip_min: float | None = None
    """Least normal force of a hand [N]; the scenario's own preload if left out."""

    grip_max: float = 60.0
    """Largest normal force of a hand [N]."""

    tip_speed: float = math.inf
    """Largest speed of the hands' contacts [m/s]."""

    tip_acceleration: float = math.inf
    """Largest acceleration of the hands' contacts [m/s^2]."""

    robust: bool = False
    """The plan also serves the uncertainty set of controller robust, or as much as it can."""

    stretch: float = 1.0
    """Then stretches the duration by this factor; after least-time with forces for the largest
    friction margin."""

    out: Path | None = None
    """New or empty folder for plan.json and plan.png; logs/SCENARIO-plan-TIME if left out."""

    def execute(self) -> int:
        """Does it; returns the exit code: 1 if there is no such plan."""
        from rich.console import Console

        from fulcrum.sim.planning.execution import made_plan
        from fulcrum.sim.planning.file import plan_content
        from fulcrum.sim.planning.picture import draw
        from fulcrum.sim.planning.plan import PlanError
        from fulcrum.sim.run.files import write_json

        chosen = self.chosen()
        planning = asked_planning(
            chosen,
            "--objective",
            self.objective,
            self.stretch,
            self.duration,
            self.robust,
            self.points,
        )
        margins = self._margins(chosen)
        check_results_folder(self.out)
        try:
            planned = made_plan(chosen, margins, planning)
        except PlanError as error:
            print(error)
            return FAILED
        out = results_folder(self.out, f"{chosen.name}-plan")
        write_json(out / PLAN, plan_content(planned))
        draw(planned, out / PICTURE)
        _print(Console(highlight=False), planned)
        print(f"plan: {out / PLAN}")
        return PASSED

    def _margins(self, chosen: Scenario) -> Margins:
        from fulcrum.sim.planning.problem import own_margins

        own = own_margins(chosen.control)
        return replace(
            own,
            friction_factor=(
                own.friction_factor if self.friction_factor is None else self.friction_factor
            ),
            limits=self.limits,
            grip_min=own.grip_min if self.grip_min is None else self.grip_min,
            grip_max=self.grip_max,
            tip_speed=self.tip_speed,
            tip_acceleration=self.tip_acceleration,
        )


def _print(console: Console, planned: Plan) -> None:
    import numpy as np
    from rich.box import SIMPLE
    from rich.markup import escape
    from rich.table import Table

    from fulcrum.sim.planning.file import stretches

    found = planned.solution
    rate = float(np.degrees(planned.peak_rate))
    console.print(
        f"{planned.scenario.name}, {found.problem.objective}: "
        f"[bold]{planned.duration:.4f} s[/] for {planned.scenario.path.angle_deg:g} deg, "
        f"at most {rate:.1f} deg/s; solved in {1e3 * found.solve_s:.0f} ms",
        soft_wrap=True,
    )
    if (loads := len(found.problem.loads)) > 1:
        console.print(
            f"one grip for {loads} worlds: {100 * planned.share:.0f} % of the set of controller "
            "robust",
            soft_wrap=True,
        )
    residuals = found.residuals
    console.print(
        f"limits and balance kept to {max(residuals.primal, 0.0):.1e}, optimal to "
        f"{max(residuals.dual, residuals.gap):.1e}",
        soft_wrap=True,
    )
    table = Table(escape("tilt [deg]"), "limits used up", box=SIMPLE)
    for low, high, limits in stretches(planned):
        table.add_row(f"{low:.1f} to {high:.1f}", ", ".join(limits) or "none")
    console.print(table)
    table = Table("limit", "used at most [%]", escape("at [deg]"), box=SIMPLE)
    places = np.degrees(planned.tilt[found.problem.stations[:, 0]])
    for name, share in sorted(found.shares.items(), key=lambda item: -item[1].max()):
        if share.max() >= _LISTED:
            worst = int(share.argmax())
            table.add_row(name, f"{100 * share[worst]:.1f}", f"{places[worst]:.1f}")
    console.print(table)
