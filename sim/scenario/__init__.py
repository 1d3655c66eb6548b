"""Scenario data: object, contacts, robots, path, phases, control, physics, tolerances."""

from fulcrum.sim.scenario.contacts import Friction, Hand, Rest, Support
from fulcrum.sim.scenario.control import (
    Control,
    Guard,
    comparable,
    controller,
    controllers,
    default_controller,
)
from fulcrum.sim.scenario.material import PAD, SUPPORT, ContactMaterial
from fulcrum.sim.scenario.path import Angle, Pivot, Poses
from fulcrum.sim.scenario.phases import (
    HOLD,
    LEAVE,
    REACH,
    TILT,
    Duration,
    Gap,
    Phase,
    stretched,
    tilting,
)
from fulcrum.sim.scenario.physics import Judged, Physics, Tolerances
from fulcrum.sim.scenario.robot import Robot
from fulcrum.sim.scenario.scenario import Scenario, View, lifted
from fulcrum.sim.scenario.timing import Timing
