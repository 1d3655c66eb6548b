"""Plans of the scenarios, each made once per process."""

import functools

from fulcrum.scenarios import scenario
from fulcrum.sim.planning.plan import plan
from fulcrum.sim.planning.problem import Margins

BOX, CYLINDER = "box-tilt", "cylinder-tilt"
MARGINS = {BOX: Margins(), CYLINDER: Margins(friction_factor=0.85, grip_min=10.0)}
NAMES = list(MARGINS)


@functools.cache
def fastest(name):
    return plan(scenario(name), MARGINS[name])
