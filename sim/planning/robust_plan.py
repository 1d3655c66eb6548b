"""Plans that serve as much of an uncertainty set as one timing and one grip can."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fulcrum.sim.model import RobotModel
from fulcrum.sim.planning.plan import Plan, PlanError, plan
from fulcrum.sim.planning.problem import CERTAIN, Margins
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.path import PathObjective
from fulcrum.synthesis.robust import UncertaintySet

# Shares are found to within two to the power of minus this, on a grid of so many points.
_HALVINGS, _POINTS = 4, 41


def robust_plan(
    scenario: Scenario,
    margins: Margins,
    uncertainty: UncertaintySet,
    objective: PathObjective = PathObjective.LEAST_TIME,
    duration: float = math.inf,
    points: int = 100,
    stretch: float = 1.0,
    robot: RobotModel | None = None,
) -> Plan:
    """The plan that serves the largest share of a set, itself and the scenario's own margins.

    Args:
        scenario: The scene; the timing and the forces of its own phases do not count.
        margins: What to keep clear of where the scenario is as believed.
        uncertainty: The worlds to serve.
        objective: What is minimised.
        duration: The longest that the tilt may take before it is stretched [s].
        points: Grid points.
        stretch: By how much the duration is stretched then.
        robot: The scenario's, where it is built already.

    Raises:
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits, even if all is as believed.
    """

    robot = robot or RobotModel(scenario)

    def serving(share: float, points: int) -> Plan:
        served = uncertainty.scaled(share) if share > 0.0 else CERTAIN
        found = plan(scenario, margins, objective, duration, points, served, robot)
        if stretch != 1.0:
            found = found.stretched(stretch)
        return replace(found, share=share)

    if uncertainty == CERTAIN:
        return replace(serving(0.0, points), share=1.0)
    try:
        return serving(1.0, points)
    except PlanError:
        share = 0.0
    for step in 0.5 ** np.arange(1, _HALVINGS + 1):
        try:
            serving(share + float(step), min(points, _POINTS))
        except PlanError:
            continue
        share += float(step)
    # A finer grid leaves more room, not less; but for what lies between the coarse one's points.
    for down in np.arange(share, 0.0, -(0.5**_HALVINGS)):
        try:
            return serving(float(down), points)
        except PlanError:
            continue
    return serving(0.0, points)
