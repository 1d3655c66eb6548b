"""The plant: true robots, object and contacts, simulated by MuJoCo or Drake."""

from fulcrum.sim.plant.engines import Engine, check_installed, make_plant
from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.plant.protocol import DivergedError, Plant
