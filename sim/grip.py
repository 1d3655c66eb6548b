"""How hard the hands are to press, at least, over the tilt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.contact import Array


@dataclass(frozen=True, eq=False)
class GripSchedule:
    """Normal forces of the hands over the tilt.

    Attributes:
        tilts: Grid [rad], (k,), rising.
        f_n: Normal forces [N], (k, n).
        shares: Of the uncertainty set that they serve [-], (k,); 1 is all of it.
    """

    tilts: Array
    f_n: Array
    shares: Array

    def at(self, tilts: Array) -> Array:
        """Normal forces at tilts [rad], (j,) -> (j, n); beyond the ends those at the ends."""
        columns = [np.interp(tilts, self.tilts, f_n) for f_n in self.f_n.T]
        return np.stack(columns, axis=-1)
