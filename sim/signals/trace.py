"""The trace of a run: all signals, one row per physics step."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fulcrum.synthesis.arrays import Array, Mask


def stretches(flags: Mask) -> NDArray[np.intp]:
    """Return the number of consecutive steps up to each step with the flag set, (k,), of (k,)."""
    steps = np.arange(1, len(flags) + 1)
    return steps - np.maximum.accumulate(np.where(flags, 0, steps))


@dataclass(frozen=True, eq=False)
class Trace:
    """Arrays over k steps, l joints, n hands and m contacts (hands first); SI units, world axes.

    Row i holds the state before step i, and the torques and contact forces during it.

    Attributes:
        t: Time [s], (k,).
        phase: Index of the phase, (k,).
        mode: Number of the :class:`sim.signals.event.Mode`, (k,).
        tilt_ref, rate_ref: Reference tilt [rad] and its rate [rad/s], (k,).
        tilt: Measured tilt [rad], (k,).
        p_WO, quat_WO, twist_WO: Object pose and twist (linear first), (k, 3 | 4 | 6).
        q, qd, q_ref: Joint state and reference, (k, l).
        tau: Applied torques, (k, l).
        saturated: Mask of the torques cut at their limit, (k, l).
        p_WE, quat_WE, twist_WE: Tip poses and twists, (k, n, 3 | 4 | 6).
        p_WC: Places of the plant's contacts, (k, m, 3); an open contact keeps its last place.
        f_W: Force on the object and torsional moment about the normal into it, (k, m, 4).
        w_commanded_C: Commanded wrenches on the object in contact axes, (k, m, 6).
        synthesis_s: Wall time of the synthesis; 0 where none was due, (k,).
        failed: Mask of the syntheses without solution, (k,).
        collisions: Number of contacts that the scenario does not want, (k,).
    """

    t: Array
    phase: NDArray[np.intp]
    mode: NDArray[np.intp]
    tilt_ref: Array
    rate_ref: Array
    tilt: Array
    p_WO: Array
    quat_WO: Array
    twist_WO: Array
    q: Array
    qd: Array
    q_ref: Array
    tau: Array
    saturated: Mask
    p_WE: Array
    quat_WE: Array
    twist_WE: Array
    p_WC: Array
    f_W: Array
    w_commanded_C: Array
    synthesis_s: Array
    failed: Mask
    collisions: NDArray[np.intp]

    @staticmethod
    def allocate(steps: int, joints: int, hands: int, contacts: int) -> Trace:
        """Return a trace of zeros, to be filled row by row."""
        shapes = {
            **dict.fromkeys(("q", "qd", "q_ref", "tau", "saturated"), (joints,)),
            "p_WO": (3,),
            "quat_WO": (4,),
            "twist_WO": (6,),
            "p_WE": (hands, 3),
            "quat_WE": (hands, 4),
            "twist_WE": (hands, 6),
            "p_WC": (contacts, 3),
            "f_W": (contacts, 4),
            "w_commanded_C": (contacts, 6),
        }
        kinds = {
            **dict.fromkeys(("phase", "mode", "collisions"), np.intp),
            **dict.fromkeys(("saturated", "failed"), np.bool_),
        }
        return Trace(
            **{
                f.name: np.zeros((steps, *shapes.get(f.name, ())), kinds.get(f.name, np.float64))
                for f in fields(Trace)
            }
        )

    def grown(self, steps: int) -> Trace:
        """Return a copy with `steps` additional rows of zeros."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        room = {n: np.zeros((steps, *a.shape[1:]), a.dtype) for n, a in arrays.items()}
        return Trace(**{n: np.concatenate([a, room[n]]) for n, a in arrays.items()})

    def __len__(self) -> int:
        return len(self.t)

    def rows(self, start: int, stop: int) -> Trace:
        """Return views of the rows from start to before stop."""
        return Trace(**{f.name: getattr(self, f.name)[start:stop] for f in fields(self)})

    def pick(self, rows: NDArray[np.intp]) -> Trace:
        """Return copies of the rows with the given indices."""
        return Trace(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


def torque_shares(tau: Array, tau_min: Array, tau_max: Array) -> Array:
    """Return the magnitudes of torques, (..., l), over the limits in their direction [-]."""
    return np.maximum(tau / tau_max, tau / tau_min)
