"""The command that answers before anything moves: ``fulcrum check``."""

from __future__ import annotations

import dataclasses
import math
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

if TYPE_CHECKING:
    from rich.console import Console

    from fulcrum.sim.analysis.feasibility import Feasibility
    from fulcrum.sim.scenario.scenario import Scenario

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
        from rich.console import Console

        from fulcrum.scenarios.commands.explain import print_explanation
        from fulcrum.sim.analysis.feasibility import feasibility
        from fulcrum.sim.analysis.picture import draw
        from fulcrum.sim.run.files import write_json
        from fulcrum.synthesis.errors import InvalidInputError

        check_json(self.json)
        chosen = self.chosen()
        control = chosen_control(chosen, self.controller, None)
        check_results_folder(self.out)
        found = feasibility(chosen, control)
        console = Console(highlight=False)
        _print(console, chosen, self.controller, found)
        for misfit in found.surroundings.misfits:
            console.print(misfit.text, soft_wrap=True, markup=False)
        if found.explanation is not None:
            print_explanation(console, found.explanation, self.controller)
        if found.unreachable is not None:
            console.print(self._help(found), soft_wrap=True, markup=False)
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
            print(f"figure and numbers: {out}")
        return PASSED if found.feasible else FAILED

    def _help(self, found: Feasibility) -> str:
        """What may help arms that cannot follow the path."""
        if found.slower is not None:
            return f"A tilt that lasts {found.slower:g} times as long would be slow enough."
        return (
            f"`fulcrum place {self.scenario}` seeks places for object, robots and hands from which "
            "they can."
        )


def _print(console: Console, scenario: Scenario, controller: str, found: Feasibility) -> None:
    import numpy as np
    from rich.box import SIMPLE
    from rich.markup import escape
    from rich.table import Table

    verdict = "[bold green]FEASIBLE[/]" if found.feasible else "[bold red]NOT FEASIBLE[/]"
    console.print(f"{escape(scenario.name)}, controller {controller}: {verdict}")
    curves, tilts = found.curves, found.curves.tilts_deg
    table = Table("question", "answer", "at", box=SIMPLE)
    contacts = f"{len(scenario.hands)} hands, {len(scenario.supports)} supports"
    around = found.surroundings
    for question, misfit, where in (
        ("contacts on the surface", around.supports, contacts),
        ("room for the object", around.room, ""),
        ("stands before and after", around.stand, ""),
    ):
        if misfit is None:
            table.add_row(question, "yes", where)
        else:
            table.add_row(question, "[red]no[/]: see below", f"{misfit.tilt_deg:.1f} deg")
    if found.unreachable is None:
        joint = min(found.clearances, key=lambda name: found.clearances[name])
        table.add_row("reach, speeds, collisions", "yes", "")
        near = f"{found.clearances[joint]:.3g} rad or m"
        table.add_row("least distance to a joint limit", near, joint)
    else:
        reasons = escape("; ".join(found.unreachable.reasons))
        where = f"{found.unreachable.tilt_deg:.1f} deg"
        table.add_row("reach, speeds, collisions", f"[red]no[/]: {reasons}", where)
    held = np.isfinite(curves.used)
    if held.all():
        table.add_row("forces over the path", "yes", f"0 to {tilts[-1]:g} deg")
    else:
        none = f"{tilts[~held][0]:.3g} deg, and {np.count_nonzero(~held) - 1} more of {len(tilts)}"
        table.add_row("forces over the path", "[red]no[/]", none)
    if held.any():
        step, hand = np.unravel_index(np.nanargmax(curves.grip), curves.grip.shape)
        where = f"{scenario.hands[hand].name}, {tilts[step]:.3g} deg"
        table.add_row("largest grip", f"{curves.grip[step, hand]:.1f} N", where)
        if np.isfinite(curves.torque).any():
            k = int(np.nanargmax(curves.torque))
            where = f"{curves.joint[k]}, {tilts[k]:.3g} deg"
            table.add_row("largest torque", f"{100.0 * curves.torque[k]:.0f} % of its limit", where)
        k = int(np.nanargmax(curves.used))
        where = f"{curves.contact[k]}, {tilts[k]:.3g} deg"
        table.add_row("least friction margin", f"{100.0 * (1.0 - curves.used[k]):.0f} %", where)
    if found.grip is not None:
        k = int(np.argmin(found.grip.shares))
        where = f"{math.degrees(found.grip.tilts[k]):g} deg"
        share = f"{100.0 * found.grip.shares[k]:.0f} %"
        table.add_row("uncertainty borne by one grip", share, where)
    console.print(table)


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
