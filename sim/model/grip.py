"""Least normal forces of the hands over the tilt."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fulcrum.synthesis import Contact
from fulcrum.synthesis.arrays import Array


@dataclass(frozen=True, eq=False)
class GripSchedule:
    """Least normal forces of the hands over the tilt.

    Attributes:
        tilts: Grid of tilts [rad], (k,), increasing.
        f_n: Normal forces [N], (k, n).
        shares: Share of the required robustness that they give [-], (k,); 1 is all of it.
        least: Whether no smaller force may be used, so that a step over the tilt uses the largest
            force within it.
    """

    tilts: Array
    f_n: Array
    shares: Array
    least: bool = False

    def at(self, tilts: Array) -> Array:
        """Return the normal forces [N], (j, n), at tilts [rad], (j,), clipped to the grid."""
        columns = [np.interp(tilts, self.tilts, f_n) for f_n in self.f_n.T]
        return np.stack(columns, axis=-1)

    def largest(self, start: float, stop: float) -> Array:
        """Return the largest normal force of each hand [N], (n,), between two tilts [rad]."""
        within = self.f_n[(start < self.tilts) & (self.tilts < stop)]
        ends: Array = self.at(np.array([start, stop]))
        return np.concatenate([ends, within]).max(axis=0)


def pressed(contacts: tuple[Contact, ...], f_n: Array) -> tuple[Contact, ...]:
    """Return the contacts, hands first, with least normal forces f_n [N], (n,), of the hands."""
    hands = (
        replace(contact, f_n_min=min(float(force), contact.f_n_max))
        for contact, force in zip(contacts, f_n, strict=False)
    )
    return (*hands, *contacts[len(f_n) :])
