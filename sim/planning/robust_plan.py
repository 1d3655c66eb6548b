"""Plans for the largest share of an uncertainty set that one timing and one grip serve."""

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

# Number of bisections of the share, which is accurate to 2^-n; number of grid points for it.
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
    """Return the plan that serves the largest share of a set, and the margins in the scenario.

    Args:
        scenario: The scene; timing and grip of its phases are not used.
        margins: Margins to all limits without deviations.
        uncertainty: Set of deviations to serve.
        objective: Objective that is minimised.
        duration: Longest duration of the tilt before it is stretched [s].
        points: Number of grid points.
        stretch: Factor on the planned duration [-].
        robot: Model of the scenario's robots; built if left out.

    Raises:
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits, even without deviations.
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
    # A finer grid usually allows a larger share, but its additional points may also exclude one.
    for down in np.arange(share, 0.0, -(0.5**_HALVINGS)):
        try:
            return serving(float(down), points)
        except PlanError:
            continue
    return serving(0.0, points)
