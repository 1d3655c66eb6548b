"""Progress of a long computation, reported to a callback."""

from __future__ import annotations

from collections.abc import Callable

# Called with the number of steps done and the total number of steps.
Progress = Callable[[int, int], None]
