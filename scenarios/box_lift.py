"""Baxter lifts the box of Table II off while it turns it: what the paper shows to be infeasible."""

from dataclasses import replace

from scenarios.box_tilt import SCENARIO as BOX_TILT
from sim.scenario import Pivot, lifted
from sim.settings import HOLD, REACH, TILT

assert isinstance(BOX_TILT.path, Pivot)
SCENARIO = replace(
    lifted(BOX_TILT),
    name="box-lift",
    summary="Baxter lifts the box off and turns it in the air (paper: infeasible)",
    path=replace(BOX_TILT.path, travel=(0.0, 0.0, 0.1)),
    phases=(*REACH, *TILT, *HOLD),
)
