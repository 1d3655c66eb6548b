"""Robots move heavy objects by leaning them on their surroundings: a closed-loop testbed.

A name is imported when it is first used: `import fulcrum` takes a millisecond, and
`fulcrum.synthesis` never imports a simulator.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fulcrum import assets, scenarios, sim, synthesis
    from fulcrum.scenarios import scenario
    from fulcrum.scenarios.functions import (
        capacity,
        check,
        explain,
        make_environment,
        place,
        plan,
        run,
        sweep,
    )
    from fulcrum.sim.run.execute import Request
    from fulcrum.sim.world.presets import draw, preset
    from fulcrum.sim.world.world import World

    __version__: str

__all__ = [
    "Request",
    "World",
    "__version__",
    "assets",
    "capacity",
    "check",
    "draw",
    "explain",
    "make_environment",
    "place",
    "plan",
    "preset",
    "run",
    "scenario",
    "scenarios",
    "sim",
    "sweep",
    "synthesis",
]

_SUBPACKAGES = ("assets", "scenarios", "sim", "synthesis")
# Where each of the other names comes from.
_MODULES = {
    "Request": "fulcrum.sim.run.execute",
    "World": "fulcrum.sim.world.world",
    "capacity": "fulcrum.scenarios.functions",
    "check": "fulcrum.scenarios.functions",
    "draw": "fulcrum.sim.world.presets",
    "explain": "fulcrum.scenarios.functions",
    "make_environment": "fulcrum.scenarios.functions",
    "place": "fulcrum.scenarios.functions",
    "plan": "fulcrum.scenarios.functions",
    "preset": "fulcrum.sim.world.presets",
    "run": "fulcrum.scenarios.functions",
    "scenario": "fulcrum.scenarios",
    "sweep": "fulcrum.scenarios.functions",
}


def __getattr__(name: str) -> Any:
    """Import a name when it is first used."""
    if name in _SUBPACKAGES:
        return import_module(f"fulcrum.{name}")
    if name == "__version__":
        from importlib.metadata import version

        return version("fulcrum-testbed")
    if name not in _MODULES:
        raise AttributeError(f"module 'fulcrum' has no attribute {name!r}")
    value = getattr(import_module(_MODULES[name]), name)
    globals()[name] = value  # the next use finds it without this function
    return value


def __dir__() -> list[str]:
    return __all__
