"""What the controller follows, tabulated for a whole run: it depends on time alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sim.ik import JointPath
from synthesis.contact import Array


class Target(NamedTuple):
    """References at one instant.

    Attributes:
        phase: Index of the phase.
        tilt: [rad].
        grip: Share of the synthesised forces [-].
        q: Joint angles [rad or m], (l,).
        qd: Joint speeds [rad/s or m/s], (l,).
    """

    phase: int
    tilt: float
    grip: float
    q: Array
    qd: Array


class References:
    """A joint path's references at the ticks of a clock, found in one go."""

    def __init__(self, path: JointPath, timestep: float) -> None:
        """Takes a path, and the time between ticks [s]."""
        self._path, self._timestep = path, timestep
        ticks = round(path.schedule.total_s / timestep)
        # A plant's clock adds up its steps, with their rounding.
        self._times = np.concatenate([[0.0], np.cumsum(np.full(ticks, timestep))])
        self._asked = asked = path.schedule.at(self._times)
        self._q = np.empty((len(self._times), len(path.start)))
        self._qd = np.empty_like(self._q)
        for phase in range(len(path.schedule.phases)):
            rows = asked.phase == phase
            q, slope = path.at(phase, asked.progress[rows])
            self._q[rows], self._qd[rows] = q, slope * asked.rate[rows, None]

    def at(self, t: float) -> Target:
        """References at a time [s]; read off at ticks, computed between them and after the end."""
        row = round(t / self._timestep)
        if row < len(self._times) and self._times[row] == t:
            asked = self._asked
            phase, tilt, grip = asked.phase[row], asked.tilt[row], asked.grip[row]
            q, qd = self._q[row], self._qd[row]
        else:
            asked = self._path.schedule.at(t)
            phase, tilt, grip = asked.phase, asked.tilt, asked.grip
            q, slope = self._path.at(int(phase), asked.progress)
            qd = slope * asked.rate
        return Target(int(phase), float(tilt), float(grip), q, qd)
