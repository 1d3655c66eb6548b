"""True deviations from the scenario and disturbances of a run, drawn by seed."""

from fulcrum.sim.world.channel import Channel
from fulcrum.sim.world.motors import Motors
from fulcrum.sim.world.parameters import (
    PARAMETERS,
    ParameterGrid,
    overridden,
    parameter_name,
    parse_grid,
    parse_values,
)
from fulcrum.sim.world.presets import draw, preset
from fulcrum.sim.world.pushes import Pushes
from fulcrum.sim.world.sensors import Sensors
from fulcrum.sim.world.world import NO_DEVIATION, World
