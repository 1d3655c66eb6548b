"""The command that seeks where to stand and where to hold: ``fulcrum place``."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from fulcrum.scenarios.commands.common import (
    FAILED,
    PASSED,
    Chosen,
    chosen_control,
    one_of,
    progress_bar,
)
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import page

if TYPE_CHECKING:
    from fulcrum.scenarios.reading.source import Source
    from fulcrum.sim.placement import Freedom
    from fulcrum.sim.scenario import Scenario

Kept = Literal["base", "hands", "turn", "posture"]
# Share of the time for the search; start, file and picture take the rest [-].
_SEARCHED = 0.9


@dataclass(frozen=True)
class PlaceCommand(Chosen):
    """Seek where to stand and where to hold, write the improved file, and say what was gained.

    Two hands that mirror each other stay so. The best placement found has passed in closed loop.
    """

    goal: str = "largest-margin"
    """largest-margin: least share of the friction used; lowest-torque; heaviest object."""

    controller: str = "robust"
    """Whose margins count, and who runs what was found: robust, dynamic, margin or paper."""

    out: Path | None = None
    """New file; NAME-placed.toml beside the file, or here, if left out. A picture goes with it."""

    overwrite: bool = False
    """Write over a file that is there."""

    keep: tyro.conf.UseAppendAction[tuple[Kept, ...]] = ()
    """What stays as it is: base, hands (their contacts), turn (about the contact normals) or
    posture; may be given more than once."""

    reach: float = 0.4
    """How far robots may move along x and y, either way [m]."""

    height: float = 0.0
    """How far they may be moved up or down [m]."""

    seconds: float = 120.0
    """Time for all of it [s]."""

    evaluations: int = 600
    """Placements to look at, at most. If the time ends before, it cannot be repeated exactly."""

    seed: int = 0
    """Draws what is looked at."""

    workers: int = 2
    """Processes."""

    def execute(self) -> int:
        """Does it; returns the exit code: 1 if nothing better was found."""

        from fulcrum.scenarios.reading.file import bring_schema, made
        from fulcrum.scenarios.reading.placed import placed
        from fulcrum.scenarios.reading.source import Source
        from fulcrum.sim.placement import Effort, Goal, placement_page
        from fulcrum.sim.placement.picture import draw
        from fulcrum.sim.placement.search import search

        goal = one_of(Goal, "--goal", self.goal)
        effort = Effort(self.evaluations, _SEARCHED * self.seconds, self.seed, self.workers)
        scenario = self.chosen()
        control = chosen_control(scenario, self.controller, None)
        source, out = self._source(), self._out()
        freedom = self._freedom(scenario, source)
        with progress_bar(f"{scenario.name}, {goal}") as move:
            found = search(scenario, self.controller, goal, freedom, effort, move)
        show(placement_page(scenario, found))
        if not found.improved:
            return FAILED
        elsewhere = out.absolute().parent != source.file.absolute().parent
        note = f"Placed by `fulcrum place {shlex.join(self._words())}`."
        text = placed(source.file.read_text("utf-8-sig"), scenario, found.scenario, note, elsewhere)
        made(Source(out, text), self.allow_path)  # a file that it names may be out of its reach now
        if elsewhere:
            bring_schema(out.parent)
        out.write_text(text, encoding="utf-8")
        picture = out.with_suffix(".png")
        draw(scenario, found, control, picture)
        show(page(f"{out}; picture: {picture}"))
        return PASSED

    def _words(self) -> list[str]:
        """The command line, but for where it writes to and how many processes it takes."""
        words = [*self.words, "--goal", self.goal, "--controller", self.controller]
        words += [word for kept in self.keep for word in ("--keep", kept)]
        words += ["--reach", f"{self.reach:g}", "--height", f"{self.height:g}"]
        return [*words, "--evaluations", f"{self.evaluations}", "--seed", f"{self.seed}"]

    def _source(self) -> Source:
        """The scenario's file.

        Raises:
            FileError: It says no more than that another scenario is lifted.
        """
        from fulcrum.scenarios.reading.file import named_file, open_source

        source = open_source(named_file("scenario", self.scenario))
        if "lifted_from" in source.data:
            other = f'"{source.data["lifted_from"]}"'
            raise source.error(("lifted_from",), other, "left out: place that one instead")
        return source

    def _out(self) -> Path:
        """The file to write.

        Raises:
            InvalidInputError: It is there already, has another ending, or its folder is not there.
        """
        from fulcrum.scenarios.reading.file import SUFFIX
        from fulcrum.scenarios.reading.placed import beside
        from fulcrum.synthesis import InvalidInputError

        named = Path(self.scenario if self.scenario.endswith(SUFFIX) else self.scenario + SUFFIX)
        out = self.out or beside(named)
        if out.suffix != SUFFIX or not out.parent.is_dir():
            raise InvalidInputError("--out", out, f"a file {SUFFIX} in a folder that exists")
        taken = [file for file in (out, out.with_suffix(".png")) if file.exists()]
        if taken and not self.overwrite:
            valid = f"another one, as {taken[0]} exists, or --overwrite"
            raise InvalidInputError("--out", out, valid)
        return out

    def _freedom(self, scenario: Scenario, source: Source) -> Freedom:
        """What may move.

        Raises:
            InvalidInputError: A distance is no number >= 0.
        """
        from fulcrum.sim.placement import Freedom
        from fulcrum.synthesis.checks import not_negative

        not_negative("--reach", self.reach)
        not_negative("--height", self.height)
        still, whole = (0.0, 0.0), Freedom()
        along = still if "base" in self.keep else (-self.reach, self.reach)
        tables = source.data["hands"]
        faces = {h.name: tuple(tables[h.name].get("may_touch", ())) for h in scenario.hands}
        return Freedom(
            x=along,
            y=along,
            height=still if "base" in self.keep else (-self.height, self.height),
            yaw_deg=still if "base" in self.keep else whole.yaw_deg,
            faces={} if "hands" in self.keep else faces,
            turn_deg=still if "turn" in self.keep else whole.turn_deg,
            posture_deg=still if "posture" in self.keep else whole.posture_deg,
        )
