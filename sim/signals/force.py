"""An external force on the object."""

from __future__ import annotations

from typing import NamedTuple

from fulcrum.synthesis.arrays import Array


class AppliedForce(NamedTuple):
    """A force on the object during one step.

    Attributes:
        force_W: Force in world axes [N], (3,).
        p_OA_O: Point of application in the object frame [m], (3,); None for the centre of mass.
    """

    force_W: Array
    p_OA_O: Array | None
