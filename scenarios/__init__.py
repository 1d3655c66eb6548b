"""The scenarios: every module here with a ``SCENARIO`` is one, found by being present."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim.scenario import Scenario


@cache
def scenarios() -> dict[str, Scenario]:
    """All scenarios by name."""
    found = {}
    for module in pkgutil.iter_modules(__path__):
        scenario = getattr(importlib.import_module(f"{__name__}.{module.name}"), "SCENARIO", None)
        if scenario is not None:
            found[scenario.name] = scenario
    return found


def scenario(name: str) -> Scenario:
    """The scenario of a name.

    Raises:
        InvalidInputError: There is none of that name.
    """
    if name not in scenarios():
        from synthesis.errors import InvalidInputError

        raise InvalidInputError("scenario", repr(name), f"one of {', '.join(scenarios())}")
    return scenarios()[name]
