"""What of a world a grid may set and a map may show, and how people write it down."""

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

# Rounds off what evenly spaced values have of the binary system, so that commands stay short.
_DIGITS = 12


@dataclass(frozen=True)
class Parameter:
    """One number of a world, or one for several of its numbers.

    Attributes:
        name: As in commands; the column of a sweep's rows is ``world.NAME``.
        unit: For the labels of axes.
        field: Of :class:`sim.world.world.World`.
        entries: Which entries of the field in a scenario; None for a field that is one number.
    """

    name: str
    unit: str
    field: str
    entries: Callable[[Scenario], slice] | None = None

    def read(self, world: World, scenario: Scenario) -> float:
        """Its value in a world: of several entries the least, which is what friction fails by."""
        value = getattr(world, self.field)
        if self.entries is None:
            return float(value)
        return float(min(value[self.entries(scenario)], default=1.0))

    def set(self, world: World, scenario: Scenario, value: float) -> World:
        """The world with this value in all of its entries."""
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
# Gravity is what it is: a factor on the weight is one on the mass.
_ALSO = {"weight": "mass"}


def parameter_name(field: str, text: str) -> str:
    """The parameter that is meant.

    Raises:
        InvalidInputError: There is none of that name.
    """
    name = _ALSO.get(text.strip(), text.strip())
    if name not in PARAMETERS:
        raise InvalidInputError(field, repr(text), f"one of weight, {', '.join(PARAMETERS)}")
    return name


def overridden(world: World, scenario: Scenario, values: Mapping[str, float]) -> World:
    """A drawn world with some of its parameters set.

    Raises:
        InvalidInputError: A value is not valid.
    """
    for name, value in values.items():
        world = PARAMETERS[name].set(world, scenario, value)
    return world


def parse_values(field: str, text: str) -> dict[str, float]:
    """One value per parameter, from text like ``friction=0.8,mass=1.1``.

    Raises:
        InvalidInputError: The text is not of that form.
    """
    grid = parse_grid(field, text)
    for name, values in grid:
        if len(values) > 1:
            raise InvalidInputError(field, repr(text), f"one value of {name}, like {name}=0.8")
    return {name: values[0] for name, values in grid}


def parse_grid(field: str, text: str) -> ParameterGrid:
    """Values per parameter, from text like ``friction=0.7:1.3:7,mass=0.8,1.0,1.2``.

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
