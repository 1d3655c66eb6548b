"""Checks of inputs; every error names the field, what was given and what is valid."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.errors import InvalidInputError

# Tolerance of unit length and of right angles: directions are typed in with a few digits.
_DIRECTION = 1e-6


def positive(field: str, value: float) -> None:
    """Raise InvalidInputError unless the value is a finite number > 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise InvalidInputError(field, value, "a finite number > 0")


def not_negative(field: str, value: float) -> None:
    """Raise InvalidInputError unless the value is a finite number >= 0."""
    if not (math.isfinite(value) and value >= 0.0):
        raise InvalidInputError(field, value, "a finite number >= 0")


def each(prefix: str, config: Any, check: Callable[[str, float], None]) -> None:
    """Apply a check to every field of a dataclass of numbers; errors name `prefix.field`."""
    for field in fields(config):
        check(f"{prefix}.{field.name}", getattr(config, field.name))


def finite(field: str, vector: Sequence[float]) -> None:
    """Raise InvalidInputError if a number is NaN or infinite."""
    if not all(math.isfinite(x) for x in vector):
        raise InvalidInputError(field, vector, "finite numbers")


def length(field: str, values: Sequence[float], size: int) -> None:
    """Raise InvalidInputError unless there are `size` numbers."""
    if len(values) != size:
        raise InvalidInputError(field, values, f"{size} numbers")


def vector(field: str, values: Sequence[float], size: int) -> None:
    """Raise InvalidInputError unless there are `size` finite numbers."""
    length(field, values, size)
    finite(field, values)


def shape(field: str, array: Array, valid: tuple[int, ...]) -> None:
    """Raise InvalidInputError unless the array has the valid shape."""
    if np.shape(array) != valid:
        raise InvalidInputError(field, f"shape {np.shape(array)}", f"shape {valid}")


def array(field: str, values: Array, valid: tuple[int, ...]) -> None:
    """Raise InvalidInputError unless the array has the valid shape and finite numbers."""
    shape(field, values, valid)
    sum_of_squares(field, values)


def sum_of_squares(field: str, values: Array) -> float:
    """Return the sum of squares; raise InvalidInputError if a number is NaN or infinite."""
    flat = values.ravel()
    squares = float(flat.dot(flat))
    # A finite sum proves at once that all numbers are finite; an infinite one may be an overflow.
    if not math.isfinite(squares) and not np.isfinite(values).all():
        raise InvalidInputError(field, "a value that is NaN or infinite", "finite numbers")
    return squares


def whole(field: str, value: object, least: int) -> None:
    """Raise InvalidInputError unless the value is an integer of at least `least`."""
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InvalidInputError(field, value, f"an integer >= {least}")


def axes(
    field: str, normal: tuple[str, Sequence[float]], tangent: tuple[str, Sequence[float]]
) -> None:
    """Raise InvalidInputError unless two named vectors have length 1 and are perpendicular."""
    for name, values in (normal, tangent):
        if len(values) != 3 or not abs(math.hypot(*values) - 1.0) < _DIRECTION:
            raise InvalidInputError(f"{field}.{name}", values, "a vector of length 1")
    if not abs(sum(n * t for n, t in zip(normal[1], tangent[1], strict=True))) < _DIRECTION:
        raise InvalidInputError(
            f"{field}.{tangent[0]}", tangent[1], f"perpendicular to {normal[0]} {normal[1]}"
        )
