"""The controller's command to the motors at one step."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.sim.signals.event import Mode
from fulcrum.synthesis.arrays import Array, Mask


class Command(NamedTuple):
    """Torques of one step, with the references and forces that they follow.

    Attributes:
        tau: Torques within the limits [N·m or N], (l,).
        saturated: Mask of the torques cut at their limit, (l,).
        phase: Index of the phase.
        mode: Mode of the run.
        q_ref: Reference angles [rad or m], (l,).
        tilt_ref, rate_ref: Reference tilt [rad] and its rate [rad/s].
        w_commanded_C: Commanded wrenches on the object in contact axes [N, N·m], (m, 6).
        synthesis_s: Wall time of this tick's synthesis [s]; 0 where none was due.
        failed: Whether this tick's synthesis had no solution; then the last forces, or those
            nearest to balance, are applied.
    """

    tau: Array
    saturated: Mask
    phase: int
    mode: Mode
    q_ref: Array
    tilt_ref: float
    rate_ref: float
    w_commanded_C: Array
    synthesis_s: float
    failed: bool
