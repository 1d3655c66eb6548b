"""How hard the hands are to press, at least, over the tilt."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fulcrum.synthesis import Contact
from fulcrum.synthesis.arrays import Array


@dataclass(frozen=True, eq=False)
class GripSchedule:
    """Normal forces of the hands over the tilt.

    Attributes:
        tilts: Grid [rad], (k,), rising.
        f_n: Normal forces [N], (k, n).
        shares: Of the robustness asked for that they give [-], (k,); 1 is all of it.
        least: Whether less is too little, so that a step over the tilt takes the largest within it.
    """

    tilts: Array
    f_n: Array
    shares: Array
    least: bool = False

    def at(self, tilts: Array) -> Array:
        """Normal forces at tilts [rad], (j,) -> (j, n); beyond the ends those at the ends."""
        columns = [np.interp(tilts, self.tilts, f_n) for f_n in self.f_n.T]
        return np.stack(columns, axis=-1)

    def largest(self, start: float, stop: float) -> Array:
        """Largest normal force of each hand between two tilts [rad], (n,)."""
        within = self.f_n[(start < self.tilts) & (self.tilts < stop)]
        ends: Array = self.at(np.array([start, stop]))
        return np.concatenate([ends, within]).max(axis=0)


def pressed(contacts: tuple[Contact, ...], f_n: Array) -> tuple[Contact, ...]:
    """Contacts, hands first, with these least normal forces of the n hands [N], (n,)."""
    hands = (
        replace(contact, f_n_min=min(float(force), contact.f_n_max))
        for contact, force in zip(contacts, f_n, strict=False)
    )
    return (*hands, *contacts[len(f_n) :])
