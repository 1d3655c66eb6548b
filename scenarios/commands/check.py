"""`fulcrum check`: reach, limits and forces, before anything moves."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.sim.analysis import Feasibility

RESULT, PICTURE = "check.json", "check.png"


@dataclass(frozen=True)
class CheckCommand(common.Chosen):
    """Check a scenario before anything moves: contacts, space, reach, joint limits and forces."""

    controller: str = "robust"
    """Controller whose margins and grip count: robust, margin, paper or no-feedforward."""

    out: common.MaybePath = None
    """New or empty folder for check.png and check.json; by default logs/SCENARIO-check-TIME."""

    json: common.MaybePath = None
    """JSON file for the result, instead of check.json in that folder."""

    def execute(self) -> int:
        """Run the command; return the exit code: 0 feasible, 1 not feasible."""
        from fulcrum.scenarios import functions
        from fulcrum.sim.analysis.picture import draw
        from fulcrum.sim.run import write_json

        common.check_json(self.json)
        chosen = self.chosen()
        common.check_results_folder(self.out)
        found = functions.check(chosen, self.controller)
        show(found.page(chosen, self.controller) + page(self._advice(found)))
        content = {"scenario": chosen.name, "controller": self.controller, **_content(found)}
        if self.json is not None:
            write_json(self.json, content)
        try:
            out = common.results_folder(self.out, f"{chosen.name}-check")
        except InvalidInputError as error:  # the answer is printed above
            print(f"fulcrum: picture and numbers are not written: {error}", file=sys.stderr)
        else:
            draw(chosen, self.controller, found, out / PICTURE)
            if self.json is None:
                write_json(out / RESULT, content)
            show(page(f"Picture and numbers: {out}"))
        return common.PASSED if found.feasible else common.FAILED

    def _advice(self, found: Feasibility) -> str:
        """Return what may help arms that cannot follow the path; nothing if they can."""
        if found.unreachable is None:
            return ""
        if found.slower is not None:
            return f"A tilt that lasts {found.slower:g} times as long would be slow enough."
        return f"`fulcrum place {self.scenario}` searches for a placement that the arms can reach."


def _content(found: Feasibility) -> dict[str, Any]:
    """Return the result for JSON."""
    path, why = found.unreachable, found.explanation
    unreachable = None
    if path is not None:
        unreachable = {"tilt_deg": path.tilt_deg, "reasons": path.reasons, "slower": found.slower}
    return {
        "feasible": found.feasible,
        "unreachable": unreachable,
        "misfits": [misfit.text for misfit in found.surroundings.misfits],
        "clearances": found.clearances,
        "curves": {
            name: value.tolist() if hasattr(value, "tolist") else list(value)
            for name, value in vars(found.curves).items()
        },
        "explanation": None if why is None else dataclasses.asdict(why),
    }
