"""`fulcrum plan`: timing and forces of a tilt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import refuse, show
from fulcrum.synthesis.render import page

PLAN, PICTURE = "plan.json", "plan.png"


@dataclass(frozen=True)
class PlanCommand(common.Chosen):
    """Plan the fastest, least strenuous or safest tilt, with the forces along it; draw the plan."""

    objective: str = "least-time"
    """What is optimised: least-time, least-effort or friction-margin."""

    duration: common.MaybeNumber = None
    """Longest duration [s]; by default none for least-time, and the scenario's own otherwise."""

    points: int = 100
    """Number of grid points along the path."""

    friction_factor: common.MaybeNumber = None
    """Share of the friction that may be used; by default the scenario's own."""

    limits: float = 0.9
    """Share of the torque and speed limits that may be used."""

    grip_min: common.MaybeNumber = None
    """Least normal force of a hand [N]; by default the scenario's preload."""

    grip_max: float = 60.0
    """Largest normal force of a hand [N]."""

    tip_speed: float = math.inf
    """Largest speed of the hands' contacts [m/s]."""

    tip_acceleration: float = math.inf
    """Largest acceleration of the hands' contacts [m/s^2]."""

    robust: bool = False
    """Plan for as much of the uncertainty set of controller robust as one grip holds."""

    stretch: float = 1.0
    """Factor on the planned duration; stretched least-time plans get the best friction margin."""

    out: common.MaybePath = None
    """New or empty folder for plan.json and plan.png; by default logs/SCENARIO-plan-TIME."""

    def execute(self) -> int:
        """Run the command; return the exit code: 1 if there is no such plan."""
        from fulcrum.scenarios import functions
        from fulcrum.sim.planning import PlanError, own_margins, plan_content
        from fulcrum.sim.planning.picture import draw
        from fulcrum.sim.run import write_json

        chosen = self.chosen()
        common.check_results_folder(self.out)
        given = {"friction_factor": self.friction_factor, "grip_min": self.grip_min}
        margins = replace(
            own_margins(chosen.control),
            **{name: value for name, value in given.items() if value is not None},
            limits=self.limits,
            grip_max=self.grip_max,
            tip_speed=self.tip_speed,
            tip_acceleration=self.tip_acceleration,
        )
        try:
            planned = functions.plan(
                chosen,
                self.objective,
                stretch=self.stretch,
                duration=self.duration,
                robust=self.robust,
                points=self.points,
                margins=margins,
            )
        except PlanError as error:
            refuse(f"{error}")
            return common.FAILED
        out = common.results_folder(self.out, f"{chosen.name}-plan")
        write_json(out / PLAN, plan_content(planned))
        draw(planned, out / PICTURE)
        show(planned.page() + page(f"Plan: {out / PLAN}; picture: {out / PICTURE}"))
        return common.PASSED
