"""The command that answers before anything moves: ``fulcrum check``."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fulcrum.scenarios.commands.common import (
    FAILED,
    PASSED,
    Chosen,
    check_json,
    check_results_folder,
    chosen_control,
    results_folder,
)
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.sim.analysis import Feasibility

RESULT, PICTURE = "check.json", "check.png"


@dataclass(frozen=True)
class CheckCommand(Chosen):
    """Check a scenario before anything moves: its file, room, reach, limits, and forces."""

    controller: str = "robust"
    """Whose margins and grip count: robust, margin, paper or no-feedforward."""

    out: Path | None = None
    """New or empty folder for check.png and check.json; logs/SCENARIO-check-TIME if left out."""

    json: Path | None = None
    """File for the result as JSON, instead of check.json in that folder."""

    def execute(self) -> int:
        """Does it; returns the exit code: 0 feasible, 1 not feasible."""
        from fulcrum.sim.analysis.feasibility import feasibility
        from fulcrum.sim.analysis.picture import draw
        from fulcrum.sim.run import write_json
        from fulcrum.synthesis import InvalidInputError

        check_json(self.json)
        chosen = self.chosen()
        control = chosen_control(chosen, self.controller, None)
        check_results_folder(self.out)
        found = feasibility(chosen, control)
        advice = "" if found.unreachable is None else self._help(found)
        show(found.page(chosen, self.controller) + page(advice))
        content = {"scenario": chosen.name, "controller": self.controller, **_content(found)}
        if self.json is not None:
            write_json(self.json, content)
        try:
            out = results_folder(self.out, f"{chosen.name}-check")
        except InvalidInputError as error:  # the answer stands above
            print(f"fulcrum: figure and numbers are not written: {error}", file=sys.stderr)
        else:
            draw(chosen, self.controller, found, out / PICTURE)
            if self.json is None:
                write_json(out / RESULT, content)
            show(page(f"Figure and numbers: {out}"))
        return PASSED if found.feasible else FAILED

    def _help(self, found: Feasibility) -> str:
        """What may help arms that cannot follow the path."""
        if found.slower is not None:
            return f"A tilt that lasts {found.slower:g} times as long would be slow enough."
        return (
            f"`fulcrum place {self.scenario}` seeks places for object, robots and hands from which "
            "they can."
        )


def _content(found: Feasibility) -> dict[str, Any]:
    """The result for JSON."""
    path, why = found.unreachable, found.explanation
    curves = {
        name: value.tolist() if hasattr(value, "tolist") else list(value)
        for name, value in vars(found.curves).items()
    }
    unreachable = None
    if path is not None:
        unreachable = {"tilt_deg": path.tilt_deg, "reasons": path.reasons, "slower": found.slower}
    return {
        "feasible": found.feasible,
        "unreachable": unreachable,
        "misfits": [misfit.text for misfit in found.surroundings.misfits],
        "clearances": found.clearances,
        "curves": curves,
        "explanation": None if why is None else dataclasses.asdict(why),
    }
