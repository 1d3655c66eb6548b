"""Setpoint from the outer loop to the drives."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.synthesis.arrays import Array


class Setpoint(NamedTuple):
    """Forces that the drives apply until the next setpoint arrives.

    Attributes:
        tau_f: Torques that produce the contact forces [N·m or N], (l,).
        w_commanded_C: Commanded wrenches on the object in contact axes [N, N·m], (m, 6).
        J_C: Jacobians of the hands in contact axes, (n, 6, l).
    """

    tau_f: Array
    w_commanded_C: Array
    J_C: Array
