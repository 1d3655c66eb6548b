"""`fulcrum reproduce`: the paper's figures and numbers."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from fulcrum.scenarios.commands.common import FAILED, PASSED, MaybePath, results_folder
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import page

# Largest RMS error of the measured grip against the computed one, over the computed peak [-].
_GRIP_ERROR = 0.03


@dataclass(frozen=True)
class ReproduceCommand:
    """Reproduce the paper: draw figures 5 to 8, computed and measured, and compare every number."""

    out: MaybePath = None
    """New or empty folder for pictures, tables and paper.json; by default logs/reproduce-TIME."""

    def execute(self) -> int:
        """Run the command; return the exit code: 1 if a measured grip is off the computed one."""
        from rich.console import Console

        from fulcrum.scenarios.paper.reproduce import STEPS, reproduce

        out = results_folder(self.out, "reproduce")
        count = itertools.count(1)
        with Console(stderr=True).status("") as status:
            found = reproduce(out, lambda what: status.update(f"{next(count)} of {STEPS}: {what}"))
        show(found.page() + page(f"Figures: {out}"))
        worst = max(error for errors in found.grip_errors.values() for error in errors)
        return PASSED if worst <= _GRIP_ERROR else FAILED
