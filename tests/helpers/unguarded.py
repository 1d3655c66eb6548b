"""A guard that never finds anything by its thresholds: shared by tests of what happens without."""

import math
from dataclasses import fields

from fulcrum.sim.scenario.control import Guard

UNGUARDED = Guard(**dict.fromkeys((field.name for field in fields(Guard)), math.inf))
