"""Motion of hands and object in MuJoCo: logged at each step, converted for many at once."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.model import tip_site
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis.arrays import Array

# Initial capacity in steps.
_ROOM = 256
_ANGULAR, _LINEAR = slice(0, 3), slice(3, 6)


class MotionLog:
    """MuJoCo's velocities and poses of hands and object, one row per step."""

    def __init__(self, scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        tips = [model.site(tip_site(hand)).id for hand in scenario.hands]
        thing = model.body(scenario.object.name).id
        bodies = [*model.site_bodyid[tips], thing]
        # MuJoCo's velocities are those of each body's point at its tree's centre of mass.
        columns = {
            "velocity": [data.cvel[body] for body in bodies],
            "center": [data.subtree_com[root] for root in model.body_rootid[bodies]],
            "place": [data.xpos[thing]],
            "tip": [data.site_xpos[tip] for tip in tips],
            "axes": [data.site_xmat[tip] for tip in tips],
        }
        # Views of MuJoCo's arrays, which are concatenated to a row.
        self._views = [view for views in columns.values() for view in views]
        self._rows = np.zeros((_ROOM, sum(map(len, self._views))))
        self._columns: dict[str, slice] = {}
        end = 0
        for name, views in columns.items():
            start, end = end, end + sum(map(len, views))
            self._columns[name] = slice(start, end)
        self.clear()

    def clear(self) -> None:
        """Forget all steps."""
        self._steps = 0

    def append(self) -> None:
        """Log the step that was just made."""
        if self._steps == len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        np.concatenate(self._views, out=self._rows[self._steps])
        self._steps += 1

    def read(self, block: Trace) -> None:
        """Write tip poses and world twists (linear first) of the logged steps, and forget those.

        Args:
            block: Rows of the trace, one per logged step.
        """
        block.p_WE[:] = self._read("tip", 3)
        # Orthogonal up to rounding, since MuJoCo computes them from unit quaternions.
        axes = self._read("axes", 9).reshape(-1, 3, 3)
        flat = Rotation.from_matrix(axes, assume_valid=True).as_quat(scalar_first=True)
        block.quat_WE[:] = flat.reshape(block.quat_WE.shape)
        block.twist_WE[:] = self._twists(slice(0, -1), block.p_WE)
        block.twist_WO[:] = self._twists(slice(-1, None), self._read("place", 3))[:, 0]
        self.clear()

    def _read(self, name: str, width: int) -> Array:
        """Return a logged quantity of the s steps, (s, k, w)."""
        return self._rows[: self._steps, self._columns[name]].reshape(self._steps, -1, width)

    def _twists(self, bodies: slice, points: Array) -> Array:
        """Return the world twists, (s, b, 6), of bodies at points in the world, (s, b, 3)."""
        velocity = self._read("velocity", 6)[:, bodies]
        lever = points - self._read("center", 3)[:, bodies]
        turn = velocity[..., _ANGULAR]
        return np.concatenate([velocity[..., _LINEAR] + np.cross(turn, lever), turn], axis=-1)
