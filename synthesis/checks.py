"""Checks that scenario and settings share; every refusal names the field and what is valid."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

from fulcrum.synthesis.errors import InvalidInputError

# Directions are typed in with a few digits, or computed; a cone is off by as little.
_DIRECTION = 1e-6


def positive(field: str, value: float) -> None:
    """Refuses what is not a finite number > 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise InvalidInputError(field, value, "a finite number > 0")


def not_negative(field: str, value: float) -> None:
    """Refuses what is not a finite number >= 0."""
    if not (math.isfinite(value) and value >= 0.0):
        raise InvalidInputError(field, value, "a finite number >= 0")


def each(prefix: str, config: Any, check: Callable[[str, float], None]) -> None:
    """Checks every field of a dataclass of numbers, named with a prefix."""
    for field in fields(config):
        check(f"{prefix}.{field.name}", getattr(config, field.name))


def finite(field: str, vector: Sequence[float]) -> None:
    """Refuses a vector with a number that is NaN or infinite."""
    if not all(math.isfinite(x) for x in vector):
        raise InvalidInputError(field, vector, "finite numbers")


def length(field: str, values: Sequence[float], size: int) -> None:
    """Refuses what are not so many numbers."""
    if len(values) != size:
        raise InvalidInputError(field, values, f"{size} numbers")


def vector(field: str, values: Sequence[float], size: int) -> None:
    """Refuses what are not so many finite numbers."""
    length(field, values, size)
    finite(field, values)


def whole(field: str, value: object, least: int) -> None:
    """Refuses what is not an integer of at least ``least``."""
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InvalidInputError(field, value, f"an integer >= {least}")


def axes(
    field: str, normal: tuple[str, Sequence[float]], tangent: tuple[str, Sequence[float]]
) -> None:
    """Refuses a normal and a tangent, each with its name, that are not unit and perpendicular."""
    for name, values in (normal, tangent):
        if len(values) != 3 or not abs(math.hypot(*values) - 1.0) < _DIRECTION:
            raise InvalidInputError(f"{field}.{name}", values, "a vector of length 1")
    if not abs(sum(n * t for n, t in zip(normal[1], tangent[1], strict=True))) < _DIRECTION:
        raise InvalidInputError(
            f"{field}.{tangent[0]}", tangent[1], f"perpendicular to {normal[0]} {normal[1]}"
        )
