"""How hands and object move: kept step by step as MuJoCo has it, worked out for many at once."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from sim.scenario import Scenario
from sim.scene import tip_site
from synthesis.contact import Array

# Steps that there is room for at first.
_ROOM = 256
_ANGULAR, _LINEAR = slice(0, 3), slice(3, 6)


class MotionLog:
    """MuJoCo's body velocities and site poses of consecutive steps, one row per step."""

    def __init__(self, scenario: Scenario, model: mujoco.MjModel) -> None:
        self._tips = [model.site(tip_site(hand)).id for hand in scenario.hands]
        self._hands = [int(model.site_bodyid[site]) for site in self._tips]
        self._object = int(model.body(scenario.object.name).id)
        self._root = model.body_rootid.copy()
        # Velocities belong to the point of each body that is at its tree's centre of mass.
        self._velocity, self._center = (
            np.zeros((_ROOM, model.nbody, 6)),
            np.zeros((_ROOM, model.nbody, 3)),
        )
        self._body = np.zeros((_ROOM, model.nbody, 3))
        self._site = np.zeros((_ROOM, model.nsite, 3))
        self._axes = np.zeros((_ROOM, model.nsite, 9))

    def append(self, step: int, data: mujoco.MjData) -> None:
        """Keeps what belongs to the step that was just made, the one of an index in a block."""
        if step >= len(self._body):
            self._grow()
        self._velocity[step], self._center[step] = data.cvel, data.subtree_com
        self._body[step], self._site[step] = data.xpos, data.site_xpos
        self._axes[step] = data.site_xmat

    def _grow(self) -> None:
        for name in ("_velocity", "_center", "_body", "_site", "_axes"):
            array = getattr(self, name)
            setattr(self, name, np.concatenate([array, np.zeros_like(array)]))

    def tips(self, positions: Array, quaternions: Array, twists: Array) -> None:
        """Writes the hands' tip poses and world twists (linear first) of the first s steps.

        Args:
            positions: Written with (s, n, 3) [m].
            quaternions: Written with (s, n, 4), wxyz.
            twists: Written with (s, n, 6).
        """
        steps = len(positions)
        positions[:] = self._site[:steps, self._tips]
        # Rotations to rounding, for MuJoCo makes them of unit quaternions.
        axes = self._axes[:steps, self._tips].reshape(-1, 3, 3)
        flat = Rotation.from_matrix(axes, assume_valid=True).as_quat(scalar_first=True)
        quaternions[:] = flat.reshape(quaternions.shape)
        twists[:] = self._twists(self._hands, positions)

    def object_twist(self, twists: Array) -> None:
        """Writes the world twist of the object frame, linear part first, of s steps, (s, 6)."""
        at = self._body[: len(twists), [self._object]]
        twists[:] = self._twists([self._object], at)[:, 0]

    def _twists(self, bodies: list[int], points: Array) -> Array:
        """World twists, (s, b, 6), of bodies' points that are at places in the world, (s, b, 3)."""
        velocity = self._velocity[: len(points), bodies]
        lever = points - self._center[: len(points), self._root[bodies]]
        turn = velocity[..., _ANGULAR]
        return np.concatenate([velocity[..., _LINEAR] + np.cross(turn, lever), turn], axis=-1)
