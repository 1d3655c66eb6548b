"""What the outer loop tells the drives."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.synthesis.arrays import Array


@dataclass(eq=False, slots=True)
class Setpoint:
    """What the outer loop tells the drives.

    Attributes:
        tau_f: Torques that make the contact forces [N·m or N], (l,).
        w_OC_C: Those forces on the object in contact axes [N, N·m], (m, 6).
        J_C: Jacobians of the hands in contact axes, (n, 6, l).
    """

    tau_f: Array
    w_OC_C: Array
    J_C: Array
