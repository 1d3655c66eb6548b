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
from fulcrum.scenarios.commands.terminal import refuse, show

if TYPE_CHECKING:
    from fulcrum.sim.planning import Margins
    from fulcrum.sim.scenario import Scenario

PLAN, PICTURE = "plan.json", "plan.png"


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
        from fulcrum.sim.planning import PlanError, made_plan, plan_content
        from fulcrum.sim.planning.picture import draw
        from fulcrum.sim.run import write_json

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
            refuse(f"{error}")
            return FAILED
        out = results_folder(self.out, f"{chosen.name}-plan")
        write_json(out / PLAN, plan_content(planned))
        draw(planned, out / PICTURE)
        show(planned.page())
        print(f"plan: {out / PLAN}")
        return PASSED

    def _margins(self, chosen: Scenario) -> Margins:
        from fulcrum.sim.planning import own_margins

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
