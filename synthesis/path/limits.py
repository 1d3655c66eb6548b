"""Limits of speeds and accelerations along a path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fulcrum.synthesis import InvalidInputError, checks
from fulcrum.synthesis.arrays import Array


@dataclass(frozen=True, eq=False)
class Rates:
    r"""Speeds that are limited: :math:`|x'(s)|\,\dot s \le x_{max}`.

    Attributes:
        names: Names of the r speeds.
        slopes: Derivatives by s of what moves [unit per s], (K, r).
        limits: Largest speeds [unit/s], (r,), > 0; may be infinite.
    """

    names: tuple[str, ...]
    slopes: Array
    limits: Array

    def __post_init__(self) -> None:
        checks.array("rates.slopes", self.slopes, (len(self.slopes), len(self.names)))
        _check_limits("rates.limits", self.limits, len(self.names))

    def largest(self) -> tuple[Array, list[str]]:
        """Return the largest b at each grid point, (K,), and the name of the limiting speed."""
        with np.errstate(divide="ignore"):
            each = (self.limits / np.abs(self.slopes)) ** 2
        worst = each.argmin(axis=1)
        return each.min(axis=1), [self.names[j] for j in worst]


@dataclass(frozen=True, eq=False)
class Accelerations:
    r"""Accelerations that are limited: :math:`\|x'(s)\,a + x''(s)\,b\| \le x_{max}`.

    Attributes:
        names: Names of the r points that accelerate.
        slopes: First derivatives of their positions by s [m per s], (K, r, 3).
        curvatures: Second derivatives, (K, r, 3).
        limits: Largest accelerations [m/s^2], (r,), > 0; may be infinite.
    """

    names: tuple[str, ...]
    slopes: Array
    curvatures: Array
    limits: Array

    def __post_init__(self) -> None:
        shape = (len(self.slopes), len(self.names), 3)
        checks.array("accelerations.slopes", self.slopes, shape)
        checks.array("accelerations.curvatures", self.curvatures, shape)
        _check_limits("accelerations.limits", self.limits, len(self.names))


def _check_limits(name: str, limits: Array, count: int) -> None:
    if np.shape(limits) != (count,) or not (np.asarray(limits) > 0.0).all():
        raise InvalidInputError(name, limits, f"{count} numbers > 0")
