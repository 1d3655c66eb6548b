"""What is controlled: the truth about robots, object and contacts, in one engine or another."""

from fulcrum.sim.plant.engines import Engine, check_installed, make_plant
from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.plant.protocol import DivergedError, Plant
