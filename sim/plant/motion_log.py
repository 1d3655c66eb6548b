"""How hands and object move: kept step by step as MuJoCo has it, worked out for many at once."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.model.scene import tip_site
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.synthesis.arrays import Array

# Steps that there is room for at first.
_ROOM = 256
_ANGULAR, _LINEAR = slice(0, 3), slice(3, 6)


class MotionLog:
    """MuJoCo's velocities and poses of hands and object, consecutive steps, one row per step."""

    def __init__(self, scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        tips = [model.site(tip_site(hand)).id for hand in scenario.hands]
        thing = model.body(scenario.object.name).id
        bodies = [*model.site_bodyid[tips], thing]
        # Velocities belong to the point of each body that is at its tree's centre of mass.
        columns = {
            "velocity": [data.cvel[body] for body in bodies],
            "center": [data.subtree_com[root] for root in model.body_rootid[bodies]],
            "place": [data.xpos[thing]],
            "tip": [data.site_xpos[tip] for tip in tips],
            "axes": [data.site_xmat[tip] for tip in tips],
        }
        # Views of what MuJoCo writes, put one after the other into a row.
        self._views = [view for views in columns.values() for view in views]
        self._rows = np.zeros((_ROOM, sum(map(len, self._views))))
        self._columns: dict[str, slice] = {}
        end = 0
        for name, views in columns.items():
            start, end = end, end + sum(map(len, views))
            self._columns[name] = slice(start, end)

    def append(self, step: int) -> None:
        """Keeps what belongs to the step that was just made, the one of an index in a block."""
        if step >= len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        np.concatenate(self._views, out=self._rows[step])

    def _read(self, name: str, steps: int, width: int) -> Array:
        """What was kept of the first s steps, (s, k, w)."""
        return self._rows[:steps, self._columns[name]].reshape(steps, -1, width)

    def tips(self, positions: Array, quaternions: Array, twists: Array) -> None:
        """Writes the hands' tip poses and world twists (linear first) of the first s steps.

        Args:
            positions: Written with (s, n, 3) [m].
            quaternions: Written with (s, n, 4), wxyz.
            twists: Written with (s, n, 6).
        """
        steps = len(positions)
        positions[:] = self._read("tip", steps, 3)
        # Rotations to rounding, for MuJoCo makes them of unit quaternions.
        axes = self._read("axes", steps, 9).reshape(-1, 3, 3)
        flat = Rotation.from_matrix(axes, assume_valid=True).as_quat(scalar_first=True)
        quaternions[:] = flat.reshape(quaternions.shape)
        twists[:] = self._twists(slice(0, -1), positions)

    def object_twist(self, twists: Array) -> None:
        """Writes the world twist of the object frame, linear part first, of s steps, (s, 6)."""
        places = self._read("place", len(twists), 3)
        twists[:] = self._twists(slice(-1, None), places)[:, 0]

    def _twists(self, bodies: slice, points: Array) -> Array:
        """World twists, (s, b, 6), of bodies' points that are at places in the world, (s, b, 3)."""
        velocity = self._read("velocity", len(points), 6)[:, bodies]
        lever = points - self._read("center", len(points), 3)[:, bodies]
        turn = velocity[..., _ANGULAR]
        return np.concatenate([velocity[..., _LINEAR] + np.cross(turn, lever), turn], axis=-1)
