"""References of the controller for a whole run, as a table over time."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.motion.joint_path import JointPath
from fulcrum.sim.signals import Target
from fulcrum.synthesis.arrays import Array


class References:
    """References of a joint path, computed at once for all ticks of a clock."""

    def __init__(self, path: JointPath, timestep: float) -> None:
        """Compute the references of a path, with a time between ticks of `timestep` [s]."""
        self._path, self._timestep = path, timestep
        ticks = round(path.schedule.total_s / timestep)
        # A cumulative sum, since the plant's clock adds up its steps with the same rounding.
        times = np.concatenate([[0.0], np.cumsum(np.full(ticks, timestep))])
        asked = path.schedule.at(times)
        self._q = np.empty((len(times), len(path.start)))
        self._qd, self._qdd = np.empty_like(self._q), np.empty_like(self._q)
        for phase in range(len(path.schedule.phases)):
            rows = asked.phase == phase
            progress = asked.progress[rows], asked.rate[rows, None], asked.acceleration[rows, None]
            self._q[rows], self._qd[rows], self._qdd[rows] = _motion(path, phase, *progress)
        # Python numbers: reading them one by one is several times faster than from an array.
        self._times = times.tolist()
        rate, acceleration = asked.turn * asked.rate, asked.turn * asked.acceleration
        self._phase, self._tilt, self._grip, self._rate, self._acceleration = (
            column.tolist() for column in (asked.phase, asked.tilt, asked.grip, rate, acceleration)
        )

    def at(self, t: float) -> Target:
        """Return the references at a time [s]: from the table at ticks, computed at other times."""
        row = round(t / self._timestep)
        if row < len(self._times) and self._times[row] == t:
            return Target(
                self._phase[row],
                self._tilt[row],
                self._grip[row],
                self._q[row],
                self._qd[row],
                self._rate[row],
                self._acceleration[row],
                self._qdd[row],
            )
        asked, path = self._path.schedule.at(t), self._path
        phase = int(asked.phase)
        q, qd, qdd = _motion(path, phase, asked.progress, asked.rate, asked.acceleration)
        rate, acceleration = float(asked.turn * asked.rate), float(asked.turn * asked.acceleration)
        return Target(phase, float(asked.tilt), float(asked.grip), q, qd, rate, acceleration, qdd)


def _motion(
    path: JointPath, phase: int, progress: Array, rate: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Return angles, speeds and accelerations of the joints at a phase's progress and its rates."""
    q, slope = path.at(phase, progress)
    curvature = path.curvature(phase, progress)
    return q, slope * rate, slope * acceleration + curvature * rate**2
