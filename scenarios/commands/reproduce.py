"""The command that reproduces the paper: ``fulcrum reproduce``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fulcrum.scenarios.commands.common import FAILED, PASSED, results_folder
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import page

# How well measured grip has to follow the computed curve, RMS over its peak [-].
_GRIP_ERROR = 0.03


@dataclass(frozen=True)
class ReproduceCommand:
    """Draw the paper's figures 5 to 8, computed and measured; compare every number it states."""

    out: Path | None = None
    """New or empty folder for pictures, tables and paper.json; logs/reproduce-TIME if left out."""

    def execute(self) -> int:
        """Does it; returns the exit code: 1 if a closed loop strays from what was computed."""
        from rich.console import Console

        from fulcrum.scenarios.paper.reproduce import STEPS, reproduce

        out = results_folder(self.out, "reproduce")
        console = Console(stderr=True)
        done = 0

        def step(what: str) -> None:
            nonlocal done
            done += 1
            status.update(f"{done} of {STEPS}: {what}")

        with console.status("") as status:
            found = reproduce(out, step)
        show(found.page() + page(f"Figures: {out}"))
        worst = max(error for errors in found.grip_errors.values() for error in errors)
        return PASSED if worst <= _GRIP_ERROR else FAILED
