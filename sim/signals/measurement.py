"""Measured state at one instant."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.synthesis.arrays import Array


class Measurement(NamedTuple):
    """The state of joints and object at one instant, true or as measured by sensors.

    Attributes:
        t: Time [s].
        q: Joint angles [rad or m], (l,), in the order of the motors.
        qd: Joint speeds [rad/s or m/s], (l,).
        p_WO: Position of the object [m], (3,).
        quat_WO: Orientation of the object, (4,), wxyz.
        tau: Motor torques during the last step [N·m or N], (l,).
    """

    t: float
    q: Array
    qd: Array
    p_WO: Array
    quat_WO: Array
    tau: Array
