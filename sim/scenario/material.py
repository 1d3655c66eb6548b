"""Material of a contact: stiffness and damping, as measured on a bench."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import positive


@dataclass(frozen=True)
class ContactMaterial:
    r"""Stiffness and damping of a contact along its normal: :math:`f = K x + D \dot x`.

    x is the approach of the two bodies since they touched [m]. Pad and object (or object and
    support) are two springs in series; K is the stiffness of both together.

    Attributes:
        stiffness: K [N/m].
        damping_s: D / K [s], the time constant with which a released contact opens.
    """

    stiffness: float
    damping_s: float

    def __post_init__(self) -> None:
        positive("material.stiffness", self.stiffness)
        positive("material.damping_s", self.damping_s)

    @property
    def damping(self) -> float:
        """D [N·s/m]."""
        return self.stiffness * self.damping_s

    @staticmethod
    def hertz(
        modulus: float, radius: float, load: float, damping_s: float, poisson: float = 0.5
    ) -> ContactMaterial:
        r"""Return the material of a ball on a much harder flat, at a load.

        .. math:: F = \tfrac43 E^* \sqrt R\, x^{3/2}, \qquad E^* = \frac{E}{1 - \nu^2}, \qquad
            K = \frac{\mathrm d F}{\mathrm d x} = \left( 6\, E^{*2} R\, F \right)^{1/3}

        Source: Johnson, Contact Mechanics, 1985, (4.23).

        Args:
            modulus: Young's modulus E of the ball [Pa].
            radius: R [m].
            load: Normal force F at which the slope K is taken [N].
            damping_s: D / K [s].
            poisson: Poisson's ratio [-]; rubber has 0.5.
        """
        for name, value in (("modulus", modulus), ("radius", radius), ("load", load)):
            positive(f"material.{name}", value)
        if not 0.0 <= poisson <= 0.5:
            raise InvalidInputError("material.poisson", poisson, "in [0, 0.5]")
        effective = modulus / (1.0 - poisson**2)
        return ContactMaterial(math.cbrt(6.0 * effective**2 * radius * load), damping_s)

    def scaled(self, factor: float) -> ContactMaterial:
        """Return a copy with stiffness and damping multiplied by `factor`."""
        return ContactMaterial(factor * self.stiffness, self.damping_s)


# A ball of 30 mm radius of soft rubber (E = 2 MPa, Shore A 40 to 50) under 50 N, by Hertz: 4.0e4
# N/m. Rubber loses little: D / K = 2 ms.
PAD = ContactMaterial(stiffness=4e4, damping_s=0.002)

# The edge of a packed object on a table: an assumed value, ten times that of a pad. With D / K =
# 5 ms an edge that is set down comes to rest at once; with 2 ms it chatters.
SUPPORT = ContactMaterial(stiffness=4e5, damping_s=0.005)
