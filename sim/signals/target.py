"""References at one instant."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.synthesis.arrays import Array


class Target(NamedTuple):
    """References at one instant.

    Attributes:
        phase: Index of the phase.
        tilt: Tilt [rad].
        grip: Share of the synthesised forces [-].
        q: Joint angles [rad or m], (l,).
        qd: Joint speeds [rad/s or m/s], (l,).
        rate, acceleration: First and second derivatives of the tilt [rad/s, rad/s^2].
        qdd: Joint accelerations [rad/s^2 or m/s^2], (l,), or None.
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
        """Return the target for a rate of path time [s/s] and its derivative `change` [1/s].

        Position, phase and grip are unchanged; speeds and accelerations follow the chain rule.
        """
        qdd = None if self.qdd is None else rate**2 * self.qdd + change * self.qd
        acceleration = rate**2 * self.acceleration + change * self.rate
        return self._replace(
            qd=rate * self.qd, rate=rate * self.rate, acceleration=acceleration, qdd=qdd
        )
