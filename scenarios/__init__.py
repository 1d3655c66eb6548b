"""The scenarios: every file in the folder ``scenes`` is one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fulcrum.scenarios.reading.library import scenario, scenarios

__all__ = ["scenario", "scenarios"]


def __getattr__(name: str) -> Any:
    """Import late: the command line, in this package, prints its help without them."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from fulcrum.scenarios.reading import library

    return getattr(library, name)
