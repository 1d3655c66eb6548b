"""What the controller sees of the plant's state: the truth, with noise."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.plant import Measurement
from sim.world import World
from synthesis.contact import Array

# Speeds come from angles through a filter of this bandwidth, which makes noise of their noise.
_SPEED_FILTER = 100.0  # [rad/s]


class Sensors:
    """Encoders and the tracking of the object."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._random = np.random.default_rng([world.seed, 1])

    def see(self, truth: Measurement) -> Measurement:
        """The measurement as the controller gets it."""
        world = self._world
        if world.encoder_noise > 0.0:
            truth.q = truth.q + self._noise(world.encoder_noise, truth.q.size)
            truth.qd = truth.qd + self._noise(world.encoder_noise * _SPEED_FILTER, truth.qd.size)
        if world.position_noise > 0.0:
            truth.p_WO = truth.p_WO + self._noise(world.position_noise, 3)
        if world.orientation_noise > 0.0:
            turned = truth.quat_WO.copy()
            mujoco.mju_quatIntegrate(turned, self._noise(world.orientation_noise, 3), 1.0)
            truth.quat_WO = turned
        return truth

    def _noise(self, deviation: float, size: int) -> Array:
        return deviation * self._random.standard_normal(size)
