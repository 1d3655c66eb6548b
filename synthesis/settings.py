"""Settings classes: each field declares its range, its key in scenario files and its doc once.

A settings class is a frozen dataclass whose fields are keys of a table in the scenario file::

    @dataclass(frozen=True)
    class Control(Settings):
        preload: Annotated[NotNegative, Key("preload_n")] = 5.0
        \"""Least normal force of the hands [N].\"""

The annotation is the valid range, and the string below the field is its doc. Instances are checked
when they are made, and :mod:`scenarios.schema.derive` makes from the same fields the file's table,
its JSON Schema, its documentation and the output of `fulcrum new`. Files and code have the same
number in the same unit: there are no conversions. The key is the field's name, followed by the unit
if the field is in SI units and its name has no unit.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Len, Lt

from fulcrum.synthesis.errors import InvalidInputError

# Integers, because pydantic has the same two annotations with integers and typing keeps only one of
# equal annotations: with 0.0 the schema would depend on which comes first.
Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1.0)]
Fraction = Annotated[float, Ge(0), Lt(1.0)]
Spread3 = tuple[NotNegative, NotNegative, NotNegative]
Text = Annotated[str, Len(1, 200)]

_BOUNDS = (
    (Gt, ">", operator.gt, "gt"),
    (Ge, ">=", operator.ge, "ge"),
    (Lt, "<", operator.lt, "lt"),
    (Le, "<=", operator.le, "le"),
)
_HINTS: dict[type, dict[str, Any]] = {}


@dataclass(frozen=True)
class Key:
    """The key of a field in scenario files, if it is not the field's name.

    Attributes:
        name: The key; None for a field that files do not have.
    """

    name: str | None


class Inline:
    """Mark of a field whose own fields are keys of the same table."""


class OrInfinite:
    """Mark of a number that may be infinite in code, but is finite in files."""


class Unlimited:
    """Mark of a number that is infinite without a limit, in code and in files."""


class Settings:
    """Base of settings classes, which checks every field by its annotation."""

    @property
    def label(self) -> str:
        """Return the name of the instance in errors."""
        return type(self).__name__.lower()

    def __post_init__(self) -> None:
        for name, annotation in hints(type(self)).items():
            check(f"{self.label}.{name}", annotation, getattr(self, name))


def hints(settings: type) -> dict[str, Any]:
    """Return the annotations of the fields of a dataclass, with their extras."""
    if settings not in _HINTS:
        _HINTS[settings] = get_type_hints(settings, include_extras=True)
    return _HINTS[settings]


def said(annotation: Any, kind: type) -> Any:
    """Return the extra of a kind in an annotation, such as its :class:`Key`; None without one."""
    extras = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    return next((extra for extra in extras if extra is kind or isinstance(extra, kind)), None)


def check(field: str, annotation: Any, value: Any) -> None:
    """Raise InvalidInputError if a value is not valid for its annotation."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, UnionType):
        if value is not None:
            check(field, arguments[0], value)
    elif origin is tuple and arguments[-1] is not Ellipsis:
        if len(value) != len(arguments):
            raise InvalidInputError(field, value, f"{len(arguments)} numbers")
        if arguments[0] is float and not all(map(math.isfinite, value)):
            raise InvalidInputError(field, value, "finite numbers")
        for part, item in zip(arguments, value, strict=True):
            check(field, part, item)
    elif origin is dict:
        for name, item in value.items():
            check(f"{field}.{name}", arguments[1], item)
    elif origin is Literal:
        if value not in arguments:
            raise InvalidInputError(field, value, f"one of {', '.join(arguments)}")
    elif origin is Annotated and get_origin(arguments[0]) is not None:
        check(field, arguments[0], value)
    else:
        kind, *rules = arguments if origin is Annotated else (annotation,)
        if kind in (float, int):
            _check_number(field, kind, tuple(rules), value)


def _check_number(field: str, kind: type, rules: tuple[Any, ...], value: Any) -> None:
    bounds = [
        (sign, compare, getattr(rule, name))
        for rule in rules
        for bound, sign, compare, name in _BOUNDS
        if isinstance(rule, bound)
    ]
    if kind is int:
        good, what = isinstance(value, int) and not isinstance(value, bool), "an integer"
    elif OrInfinite in rules or Unlimited in rules:
        good, what = not math.isnan(value), "a number"
    else:
        good, what = math.isfinite(value), "a finite number"
    if not (good and all(compare(value, limit) for _, compare, limit in bounds)):
        shown = " and ".join(f"{sign} {limit:g}" for sign, _, limit in bounds)
        raise InvalidInputError(field, value, f"{what} {shown}".rstrip())
