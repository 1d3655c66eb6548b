"""Parameters of a world for grids and maps, and their text form in commands."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fulcrum.sim.scenario import Scenario
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError

ParameterGrid = tuple[tuple[str, tuple[float, ...]], ...]

# Digits to which evenly spaced values are rounded, so that commands stay short.
_DIGITS = 12


@dataclass(frozen=True)
class Parameter:
    """A named number of a world, which may stand for several entries of a field.

    Attributes:
        name: Name in commands; the column of a sweep's rows is ``world.NAME``.
        unit: Unit for the labels of axes.
        field: Name of the field of :class:`sim.world.world.World`.
        entries: Function from a scenario to the entries of the field; None for a single number.
    """

    name: str
    unit: str
    field: str
    entries: Callable[[Scenario], slice] | None = None

    def read(self, world: World, scenario: Scenario) -> float:
        """Return the parameter's value: the smallest entry, which decides for friction."""
        value = getattr(world, self.field)
        if self.entries is None:
            return float(value)
        return float(min(value[self.entries(scenario)], default=1.0))

    def set(self, world: World, scenario: Scenario, value: float) -> World:
        """Return a copy of the world with this value in all entries of the parameter."""
        if self.entries is None:
            return _changed(world, self.field, value)
        values = np.array(getattr(world, self.field), float)
        values[self.entries(scenario)] = value
        return _changed(world, self.field, tuple(values.tolist()))


def _changed(world: World, field: str, value: Any) -> World:
    return replace(world, **{field: value})


def _all(scenario: Scenario) -> slice:
    return slice(None)


def _hands(scenario: Scenario) -> slice:
    return slice(0, len(scenario.hands))


def _supports(scenario: Scenario) -> slice:
    return slice(len(scenario.hands), None)


PARAMETERS = {
    parameter.name: parameter
    for parameter in (
        Parameter("mass", "factor", "mass"),
        Parameter("size", "factor", "size"),
        Parameter("friction", "factor", "friction", _all),
        Parameter("hand_friction", "factor", "friction", _hands),
        Parameter("support_friction", "factor", "friction", _supports),
        Parameter("com_x", "m", "center_of_mass", lambda _: slice(0, 1)),
        Parameter("com_y", "m", "center_of_mass", lambda _: slice(1, 2)),
        Parameter("com_z", "m", "center_of_mass", lambda _: slice(2, 3)),
        Parameter("torque_gain", "factor", "torque_gain", _all),
        Parameter("latency", "s", "latency"),
        Parameter("dropped", "share", "dropped"),
        Parameter("position_noise", "m", "position_noise"),
        Parameter("orientation_noise", "rad", "orientation_noise"),
        Parameter("encoder_noise", "rad or m", "encoder_noise"),
        Parameter("torque_noise", "share", "torque_noise"),
        Parameter("stiffness", "factor", "stiffness", _all),
    )
}
# Gravity is constant, so a factor on the weight is one on the mass.
_ALSO = {"weight": "mass"}


def parameter_name(field: str, text: str) -> str:
    """Return the name of the parameter in a text.

    Raises:
        InvalidInputError: There is none of that name.
    """
    name = _ALSO.get(text.strip(), text.strip())
    if name not in PARAMETERS:
        raise InvalidInputError(field, repr(text), f"one of weight, {', '.join(PARAMETERS)}")
    return name


def overridden(world: World, scenario: Scenario, values: Mapping[str, float]) -> World:
    """Return a copy of a drawn world with some of its parameters set.

    Raises:
        InvalidInputError: A value is not valid.
    """
    for name, value in values.items():
        world = PARAMETERS[name].set(world, scenario, value)
    return world


def parse_values(field: str, text: str) -> dict[str, float]:
    """Return one value per parameter, from text like ``friction=0.8,mass=1.1``.

    Raises:
        InvalidInputError: The text is not of that form.
    """
    grid = parse_grid(field, text)
    for name, values in grid:
        if len(values) > 1:
            raise InvalidInputError(field, repr(text), f"one value of {name}, like {name}=0.8")
    return {name: values[0] for name, values in grid}


def parse_grid(field: str, text: str) -> ParameterGrid:
    """Return the values per parameter, from text like ``friction=0.7:1.3:7,mass=0.8,1.0,1.2``.

    ``first:last:count`` stands for evenly spaced values.

    Raises:
        InvalidInputError: The text is not of that form.
    """
    grid: dict[str, list[float]] = {}
    name = None
    for item in text.split(",") if text.strip() else []:
        before, equals, after = item.partition("=")
        if equals:
            name = parameter_name(field, before)
            if name in grid:
                raise InvalidInputError(field, repr(text), f"{name} only once")
            grid[name] = []
        if name is None:
            raise InvalidInputError(field, repr(text), "like friction=0.7:1.3:7,mass=0.8,1.2")
        grid[name] += _values(field, after if equals else item)
    for name, values in grid.items():
        if len(set(values)) < len(values):
            raise InvalidInputError(field, repr(text), f"every value of {name} only once")
    return tuple((name, tuple(values)) for name, values in grid.items())


def _values(field: str, text: str) -> list[float]:
    valid = "numbers, or FIRST:LAST:COUNT with a count from 2"
    parts = text.split(":")
    try:
        if len(parts) == 1:
            values = [float(text)]
        else:
            first, last = float(parts[0]), float(parts[1])
            count = int(parts[2]) if re.fullmatch(r"\s*\d{1,5}\s*", parts[2]) else 0
            if len(parts) != 3 or count < 2 or not math.isfinite(last - first):
                raise ValueError
            spaced = np.linspace(first, last, count)
            values = np.round(spaced, _DIGITS).tolist()
    except (ValueError, IndexError):
        raise InvalidInputError(field, repr(text), valid) from None
    if not np.isfinite(values).all():
        raise InvalidInputError(field, repr(text), valid)
    return values
