"""What is controlled: MuJoCo's truth about robot, object and contacts."""

from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.plant.protocol import DivergedError, Plant
