"""The gripper lifts the cylinder of Table I off while it turns it: infeasible in the paper, too."""

from dataclasses import replace

from scenarios.cylinder_tilt import SCENARIO as CYLINDER_TILT
from sim.scenario import Pivot, lifted

assert isinstance(CYLINDER_TILT.path, Pivot)
SCENARIO = replace(
    lifted(CYLINDER_TILT),
    name="cylinder-lift",
    summary="The gripper lifts the cylinder off and turns it in the air (paper: infeasible)",
    path=replace(CYLINDER_TILT.path, travel=(0.0, 0.0, 0.1)),
)
