"""Settings classes: a field says its range, its key in scenario files and its doc, and only once.

A settings class is a frozen dataclass whose fields are keys of a table in the scenario file::

    @dataclass(frozen=True)
    class Control(Settings):
        preload: Annotated[NotNegative, Key("preload_n")] = 5.0
        \"""Least normal force of the hands [N].\"""

The annotation says what is valid, the string below the field is its doc. From them follow the check
when an instance is made, and (:mod:`scenarios.schema.derive`) the file's table, its JSON Schema,
its documentation and what `fulcrum new` writes. Files and code hold the same number in the same
unit: there are no conversions. A key is named as its field, with the unit behind it where the field
is in SI units and has none in its name.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Len, Lt

from fulcrum.synthesis.errors import InvalidInputError

# Typing keeps one of equal annotations, and pydantic has these two with integers, too: with 0.0 the
# schema would depend on which comes first.
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
    """The key of a field in scenario files.

    Attributes:
        name: Where it is not the field's name; None for a field that files do not have.
    """

    name: str | None


class Inline:
    """Marks a field whose own fields are keys of the same table."""


class OrInfinite:
    """Marks a number that may be infinite in code; files have finite numbers only."""


class Unlimited:
    """Marks a number that is infinite where there is no limit, in code and in files."""


class Settings:
    """Base of settings classes: checks every field by its annotation when an instance is made."""

    @property
    def label(self) -> str:
        """What errors call the instance."""
        return type(self).__name__.lower()

    def __post_init__(self) -> None:
        for name, annotation in hints(type(self)).items():
            check(f"{self.label}.{name}", annotation, getattr(self, name))


def hints(settings: type) -> dict[str, Any]:
    """Annotations of the fields of a dataclass, with all that they say."""
    if settings not in _HINTS:
        _HINTS[settings] = get_type_hints(settings, include_extras=True)
    return _HINTS[settings]


def said(annotation: Any, kind: type) -> Any:
    """What of a kind an annotation says, such as its :class:`Key`; None if it says nothing."""
    extras = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    return next((extra for extra in extras if extra is kind or isinstance(extra, kind)), None)


def check(field: str, annotation: Any, value: Any) -> None:
    """Refuse a value that is not what its annotation says.

    Raises:
        InvalidInputError: Names the field, what was given and what is valid.
    """
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
