"""What the outer loop tells the drives."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.synthesis.arrays import Array


class Setpoint(NamedTuple):
    """Forces that the drives are to make until the next setpoint arrives.

    Attributes:
        tau_f: Torques that make the contact forces [N·m or N], (l,).
        w_commanded_C: Those forces on the object in contact axes [N, N·m], (m, 6).
        J_C: Jacobians of the hands in contact axes, (n, 6, l).
    """

    tau_f: Array
    w_commanded_C: Array
    J_C: Array
