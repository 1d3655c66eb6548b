r"""An estimate of the object's pose: measurements, smoothed along the path.

The estimate moves with the path from one measurement to the next. It then goes a share
:math:`\alpha = 1 - e^{-T / \tau}` of the way to the new measurement, with T the time between both.
Only the deviation from the path is smoothed, so that the estimate does not lag behind the motion.
"""

from __future__ import annotations

import math

import numpy as np

from fulcrum.sim.geometry import quaternion
from fulcrum.sim.model import ObjectPath
from fulcrum.synthesis.arrays import Array


class PoseObserver:
    """A first-order filter of the measured pose; a time constant of 0 turns it off."""

    def __init__(self, path: ObjectPath, time_constant: float) -> None:
        """Start without an estimate.

        Args:
            path: Path of the object.
            time_constant: Time constant of the filter [s].
        """
        self._path, self._tau = path, time_constant
        self._t, self._tilt = math.nan, 0.0
        self._p_WO, self._quat_WO = np.zeros(3), np.zeros(4)

    def update(self, t: float, p_WO: Array, quat_WO: Array, tilt_ref: float) -> tuple[Array, Array]:
        """Return the estimate of position [m], (3,), and orientation, (4,), wxyz.

        Args:
            t: Time of the measurement [s].
            p_WO: Measured position [m], (3,).
            quat_WO: Measured orientation, (4,), wxyz.
            tilt_ref: Commanded tilt [rad].
        """
        if self._tau == 0.0:
            return p_WO, quat_WO
        if math.isnan(self._t):
            self._p_WO, self._quat_WO = p_WO, quat_WO
        else:
            share = 1.0 - math.exp((self._t - t) / self._tau)
            self._p_WO, self._quat_WO = self._path.carry(
                self._tilt, tilt_ref, self._p_WO, self._quat_WO
            )
            self._p_WO = self._p_WO + share * (p_WO - self._p_WO)
            # Rotation vector in the object's axes.
            turn = quaternion.difference(quat_WO, self._quat_WO)
            self._quat_WO = quaternion.turned(self._quat_WO, turn, share)
        self._t, self._tilt = t, tilt_ref
        return self._p_WO, self._quat_WO
