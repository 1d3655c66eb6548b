"""References at one instant."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.synthesis.arrays import Array


class Target(NamedTuple):
    """References at one instant.

    Attributes:
        phase: Index of the phase.
        tilt: [rad].
        grip: Share of the synthesised forces [-].
        q: Joint angles [rad or m], (l,).
        qd: Joint speeds [rad/s or m/s], (l,).
        rate, acceleration: Of the tilt [rad/s, rad/s^2].
        qdd: Joint accelerations [rad/s^2 or m/s^2], (l,); None for none.
    """

    phase: int
    tilt: float
    grip: float
    q: Array
    qd: Array
    rate: float = 0.0
    acceleration: float = 0.0
    qdd: Array | None = None

    def on_clock(self, rate: float, change: float) -> Target:
        """The same place, come through at a rate of path time [-] that changes [1/s]."""
        qdd = None if self.qdd is None else rate**2 * self.qdd + change * self.qd
        acceleration = rate**2 * self.acceleration + change * self.rate
        return self._replace(
            qd=rate * self.qd, rate=rate * self.rate, acceleration=acceleration, qdd=qdd
        )
