"""The command that plans a tilt: ``fulcrum plan``."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenarios.common import FAILED, PASSED, Chosen, one_of, results_folder

if TYPE_CHECKING:
    from rich.console import Console

    from sim.plan import Plan as Planned
    from sim.plan_problem import Margins
    from sim.scenario import Scenario

PLAN, PICTURE = "plan.json", "plan.png"
# Limits with less than this at their most used are not listed.
_LISTED = 0.5


@dataclass(frozen=True)
class Plan(Chosen):
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

    mass: float = 0.0
    """Share by which the mass may be lower or higher: timing and grip serve all of these sets."""

    center: float = 0.0
    """Offset of the centre of mass along each of the object's axes, either way [m]."""

    friction: float = 0.0
    """Share by which friction may be lower, on top of the friction factor."""

    stretch: float = 1.0
    """Then stretches the duration by this factor, with forces for the largest friction margin."""

    out: Path | None = None
    """New or empty folder for plan.json and plan.png; logs/SCENARIO-plan-TIME if left out."""

    def execute(self) -> int:
        """Does it; returns the exit code: 1 if there is no such plan."""
        from rich.console import Console

        from sim.files import write_json
        from sim.plan import PlanError, plan
        from sim.plan_file import plan_content
        from sim.plan_picture import draw
        from synthesis.uncertainty_set import UncertaintySet

        chosen = self.chosen()
        objective, duration = self._asked(chosen)
        margins = self._margins(chosen)
        uncertainty = UncertaintySet(self.mass, (self.center,) * 3, self.friction)
        out = results_folder(self.out, f"{chosen.name}-plan")
        try:
            planned = plan(chosen, margins, objective, duration, self.points, uncertainty)
            if self.stretch != 1.0:
                planned = planned.stretched(self.stretch)
        except PlanError as error:
            print(error)
            return FAILED
        out.mkdir(parents=True, exist_ok=True)
        write_json(out / PLAN, plan_content(planned))
        draw(planned, out / PICTURE)
        _print(Console(highlight=False), planned)
        print(f"plan: {out / PLAN}")
        return PASSED

    def _asked(self, chosen: Scenario) -> tuple:
        """The objective and the longest duration [s]."""
        from sim.settings import tilting
        from synthesis.path_problem import PathObjective

        objective = one_of(PathObjective, "--objective", self.objective)
        if self.duration is not None:
            return objective, self.duration
        own = sum(chosen.phases[i].duration_s for i in tilting(chosen.phases))
        return objective, own if objective.needs_duration else math.inf

    def _margins(self, chosen: Scenario) -> Margins:
        from sim.plan_problem import own_margins

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


def _print(console: Console, planned: Planned) -> None:
    import numpy as np
    from rich.box import SIMPLE
    from rich.table import Table

    from sim.plan_file import stretches

    found = planned.solution
    rate = float(np.degrees(planned.peak_rate))
    console.print(
        f"{planned.scenario.name}, {found.problem.objective}: "
        f"[bold]{planned.duration:.4f} s[/] for {planned.scenario.path.angle_deg:g} deg, "
        f"at most {rate:.1f} deg/s; solved in {1e3 * found.solve_s:.0f} ms",
        soft_wrap=True,
    )
    residuals = found.residuals
    console.print(
        f"limits and balance kept to {max(residuals.primal, 0.0):.1e}, optimal to "
        f"{max(residuals.dual, residuals.gap):.1e}",
        soft_wrap=True,
    )
    table = Table("tilt [deg]", "limits used up", box=SIMPLE)
    for low, high, limits in stretches(planned):
        table.add_row(f"{low:.1f} to {high:.1f}", ", ".join(limits) or "none")
    console.print(table)
    table = Table("limit", "used at most [%]", "at [deg]", box=SIMPLE)
    places = np.degrees(planned.tilt[found.problem.stations[:, 0]])
    for name, share in sorted(found.shares.items(), key=lambda item: -item[1].max()):
        if share.max() >= _LISTED:
            worst = int(share.argmax())
            table.add_row(name, f"{100 * share[worst]:.1f}", f"{places[worst]:.1f}")
    console.print(table)
