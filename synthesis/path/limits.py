"""Limits of motion along a path: of speeds and of accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array


@dataclass(frozen=True, eq=False)
class Rates:
    r"""Speeds that are limited: :math:`|x'(s)|\,\dot s \le x_{max}`.

    Attributes:
        names: The r speeds.
        slopes: Derivatives by s of what moves [unit per s], (K, r).
        limits: [unit/s], (r,), > 0; may be infinite.
    """

    names: tuple[str, ...]
    slopes: Array
    limits: Array

    def __post_init__(self) -> None:
        check_array("rates.slopes", self.slopes, (len(self.slopes), len(self.names)))
        check_limits("rates.limits", self.limits, len(self.names))

    def largest(self) -> tuple[Array, list[str]]:
        """The largest b at each grid point, (K,), and which speed it is that limits it."""
        with np.errstate(divide="ignore"):
            each = (self.limits / np.abs(self.slopes)) ** 2
        worst = each.argmin(axis=1)
        return each.min(axis=1), [self.names[j] for j in worst]


@dataclass(frozen=True, eq=False)
class Accelerations:
    r"""Accelerations that are limited: :math:`\|x'(s)\,a + x''(s)\,b\| \le x_{max}`.

    Attributes:
        names: The r points that accelerate.
        slopes: First derivatives of their positions by s [m per s], (K, r, 3).
        curvatures: Second derivatives, (K, r, 3).
        limits: [m/s^2], (r,), > 0; may be infinite.
    """

    names: tuple[str, ...]
    slopes: Array
    curvatures: Array
    limits: Array

    def __post_init__(self) -> None:
        shape = (len(self.slopes), len(self.names), 3)
        check_array("accelerations.slopes", self.slopes, shape)
        check_array("accelerations.curvatures", self.curvatures, shape)
        check_limits("accelerations.limits", self.limits, len(self.names))


def check_array(name: str, array: Array, shape: tuple[int, ...]) -> None:
    """Refuses an array of another shape, or with numbers that are not finite."""
    if np.shape(array) != shape:
        raise InvalidInputError(name, f"shape {np.shape(array)}", f"shape {shape}")
    if not np.isfinite(array).all():
        raise InvalidInputError(name, "a value that is NaN or infinite", "finite numbers")


def check_limits(name: str, limits: Array, count: int) -> None:
    """Refuses limits that are not so many positive numbers; they may be infinite."""
    if np.shape(limits) != (count,) or not (np.asarray(limits) > 0.0).all():
        raise InvalidInputError(name, limits, f"{count} numbers > 0")
