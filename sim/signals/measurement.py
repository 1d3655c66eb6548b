"""What the controller gets to know at one instant."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

from fulcrum.synthesis.arrays import Array

with warnings.catch_warnings():  # dm_control looks for a display on import; none is needed
    warnings.simplefilter("ignore")


@dataclass(eq=False, slots=True)  # one every step, and a frozen one takes thrice as long
class Measurement:
    """What the controller gets to know at one instant.

    Attributes:
        t: Time [s].
        q: Joint angles [rad or m], (l,), in the order of the motors.
        qd: Joint speeds [rad/s or m/s], (l,).
        p_WO: Position of the object [m], (3,).
        quat_WO: Orientation of the object, (4,), wxyz.
        tau: What the motors made during the last step [N·m or N], (l,).
    """

    t: float
    q: Array
    qd: Array
    p_WO: Array
    quat_WO: Array
    tau: Array
