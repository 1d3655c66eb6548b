"""`fulcrum place`: a search for where the robots stand and where they hold the object."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import not_negative
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.scenarios.reading.source import Source
    from fulcrum.sim.placement import Freedom
    from fulcrum.sim.scenario import Scenario

Kept = Literal["base", "hands", "turn", "posture"]
# Share of the time for the search; start, file and picture take the rest [-].
_SEARCHED = 0.9
# Options that do not change the placement.
_NOT_NOTED = "out", "overwrite", "seconds", "workers"


@dataclass(frozen=True)
class PlaceCommand(common.Chosen):
    """Search for a better placement of robots and hands; write it as a new file with a picture.

    Hands that mirror each other keep doing so. The result has passed a run in closed loop.
    """

    goal: str = "largest-margin"
    """largest-margin (of friction), lowest-torque, or heaviest (object that can be held)."""

    controller: str = "robust"
    """Controller whose margins count, and which runs the result (see `fulcrum list`)."""

    out: common.MaybePath = None
    """New file, beside which a picture is drawn; by default NAME-placed.toml."""

    overwrite: bool = False
    """Overwrite existing files."""

    keep: tyro.conf.UseAppendAction[tuple[Kept, ...]] = ()
    """What stays: robots' base, contacts of the hands, their turn about the normals, posture."""

    reach: float = 0.4
    """Largest distance that the robots may be moved along x and y, either way [m]."""

    height: float = 0.0
    """Largest distance that the robots may be moved up or down [m]."""

    seconds: float = 120.0
    """Time limit [s]. A search that it ends cannot be repeated exactly."""

    evaluations: int = 600
    """Largest number of placements to try."""

    seed: int = 0
    """Seed of the search."""

    workers: int = 2
    """Number of processes."""

    def execute(self) -> int:
        """Run the command; return the exit code: 1 if nothing better was found."""
        from fulcrum.scenarios import functions
        from fulcrum.scenarios.functions import chosen_control
        from fulcrum.scenarios.reading.file import bring_schema, made
        from fulcrum.scenarios.reading.placed import placed
        from fulcrum.scenarios.reading.source import Source
        from fulcrum.sim.placement import Effort, placement_page
        from fulcrum.sim.placement.picture import draw

        effort = Effort(self.evaluations, _SEARCHED * self.seconds, self.seed, self.workers)
        scenario = self.chosen()
        source, out = self._source(), self._out()
        freedom = self._freedom(scenario, source)
        with common.progress_bar(f"{scenario.name}, {self.goal}") as move:
            found = functions.place(
                scenario,
                self.goal,
                self.controller,
                freedom=freedom,
                effort=effort,
                progress=move,
            )
        show(placement_page(scenario, found))
        if not found.improved:
            return common.FAILED
        elsewhere = out.absolute().parent != source.file.absolute().parent
        note = f"Placed by `{self.line('place', _NOT_NOTED)}`."
        text = placed(source.file.read_text("utf-8-sig"), scenario, found.scenario, note, elsewhere)
        made(Source(out, text), self.allow_path)  # a file that it names may be out of its reach now
        if elsewhere:
            bring_schema(out.parent)
        out.write_text(text, encoding="utf-8")
        picture = out.with_suffix(".png")
        draw(scenario, found, chosen_control(scenario, self.controller), picture)
        show(page(f"Scenario: {out}; picture: {picture}"))
        return common.PASSED

    def _source(self) -> Source:
        """Return the scenario's file; refuse one that lifts another scenario."""
        from fulcrum.scenarios.reading.file import named_file, open_source

        source = open_source(named_file("scenario", self.scenario))
        if "lifted_from" in source.data:
            other = f'"{source.data["lifted_from"]}"'
            raise source.error(("lifted_from",), other, "left out: place that one instead")
        return source

    def _out(self) -> Path:
        """Return the file to write; refuse one that exists, or cannot be written."""
        from fulcrum.scenarios.reading.file import SUFFIX
        from fulcrum.scenarios.reading.placed import beside

        named = Path(self.scenario if self.scenario.endswith(SUFFIX) else self.scenario + SUFFIX)
        out = self.out or beside(named)
        if out.suffix != SUFFIX or not out.parent.is_dir():
            raise InvalidInputError("--out", out, f"a file {SUFFIX} in a folder that exists")
        taken = [file for file in (out, out.with_suffix(".png")) if file.exists()]
        if taken and not self.overwrite:
            raise InvalidInputError(
                "--out", out, f"a new name, as {taken[0]} exists, or --overwrite"
            )
        return out

    def _freedom(self, scenario: Scenario, source: Source) -> Freedom:
        """Return what may move; refuse a distance that is no number >= 0."""
        from fulcrum.sim.placement import Freedom

        not_negative("--reach", self.reach)
        not_negative("--height", self.height)
        tables = source.data["hands"]
        faces = {h.name: tuple(tables[h.name].get("may_touch", ())) for h in scenario.hands}
        along, up, still = (-self.reach, self.reach), (-self.height, self.height), (0.0, 0.0)
        faces = {} if "hands" in self.keep else faces
        free = Freedom(x=along, y=along, height=up, faces=faces)
        if "base" in self.keep:
            free = replace(free, x=still, y=still, height=still, yaw_deg=still)
        if "turn" in self.keep:
            free = replace(free, turn_deg=still)
        return replace(free, posture_deg=still) if "posture" in self.keep else free
