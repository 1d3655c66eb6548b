"""What the commands share: exit codes, options, errors, progress and output files."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import tyro

from fulcrum.synthesis import FulcrumError, InvalidInputError

if TYPE_CHECKING:
    from fulcrum.sim.planning import Planning
    from fulcrum.sim.scenario import Scenario

PASSED, FAILED, BAD_INPUT, BUG, INTERRUPTED = 0, 1, 2, 70, 130

# Where runs and sweeps without a folder of their own are kept.
_LOGS = Path("logs")
# Options that may be left out: their help says what holds then, and not "None".
MaybeText = Annotated[str | None, tyro.conf.arg(metavar="STR", help_behavior_hint="")]
MaybeNumber = Annotated[float | None, tyro.conf.arg(metavar="FLOAT", help_behavior_hint="")]
MaybePath = Annotated[Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="")]

# What a function's error calls an argument: by its name alone, or as part of its settings.
_ARGUMENT = re.compile(r"(?:effort\.|margins\.)?(\w+)")


@dataclass(frozen=True)
class Chosen:
    """Options of every command on a scenario."""

    scenario: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SCENARIO")]
    """Name of a scenario (see `fulcrum list`), or a scenario file (see `fulcrum new`)."""

    allow_path: tyro.conf.UseAppendAction[tuple[Path, ...]] = field(default=(), kw_only=True)
    """Folder, besides its own, from which the scenario file may read meshes and robots."""

    def chosen(self) -> Scenario:
        """Return the scenario.

        Raises:
            InvalidInputError: There is none of that name, or the file is not valid.
        """
        from fulcrum.scenarios.reading.library import scenario

        return scenario(self.scenario, self.allow_path)

    def told(self, error: Exception) -> str:
        """Return an error as a sentence that names the option or the file, and what may help."""
        from fulcrum.scenarios.reading.file import SUFFIX, open_source
        from fulcrum.scenarios.reading.source import FileError
        from fulcrum.sim.motion import PathError

        if isinstance(error, InvalidInputError) and not isinstance(error, FileError):
            names = {option.name for option in dataclasses.fields(self)} - {"scenario"}
            argument = _ARGUMENT.fullmatch(error.field)
            if argument and argument[1] in names:
                option = f"--{argument[1].replace('_', '-')}"
                error = InvalidInputError(option, error.given, error.valid)
            if error.field.startswith("--"):
                return str(error)
        if not self.scenario.endswith(SUFFIX) or isinstance(error, (FileError, OSError)):
            return str(error)
        if not isinstance(error, PathError):
            return f"{self.scenario}: {error}"
        line = open_source(Path(self.scenario)).line(("path",))
        return (
            f"{self.scenario}:{line}: path: {str(error).rstrip('.')}; "
            f"`fulcrum place {self.scenario}` searches for a placement that works."
        )

    @property
    def words(self) -> list[str]:
        """How a command line names the scenario."""
        allowed = [("--allow-path", str(folder)) for folder in self.allow_path]
        return [self.scenario, *itertools.chain.from_iterable(allowed)]

    def line(self, command: str, without: tuple[str, ...] = (), **instead: object) -> str:
        """Return the command line of a command, without some options, or with other values."""
        words = ["fulcrum", command, *self.words]
        for option in dataclasses.fields(self):
            given = instead.get(option.name, getattr(self, option.name))
            for value in given if isinstance(given, tuple) else (given,):
                # No comparison with False: 0 is a seed.
                left_out = option.name in ("scenario", "allow_path", *without)
                if not left_out and value not in (None, "") and value is not False:
                    name = f"--{option.name.replace('_', '-')}"
                    words += [name] if value is True else [name, str(value)]
        return shlex.join(words)


@dataclass(frozen=True)
class Planned(Chosen):
    """Options of commands that may execute a planned tilt."""

    plan: MaybeText = field(default=None, kw_only=True)
    """Execute a tilt that is planned for least-time, least-effort or friction-margin."""

    stretch: float = field(default=1.0, kw_only=True)
    """Factor on the planned duration."""

    robust: bool = field(default=False, kw_only=True)
    """Plan for as much of the uncertainty set of controller robust as one grip holds."""

    duration: MaybeNumber = field(default=None, kw_only=True)
    """Duration of the tilt [s], or with --plan the longest one; by default the scenario's own."""

    def planning(self, scene: Scenario) -> Planning | None:
        """Return how the tilt is planned; None if it is not."""
        from fulcrum.scenarios.functions import chosen_planning

        return chosen_planning(scene, self.plan, self.stretch, self.duration, self.robust)


class CommandLineError(FulcrumError):
    """The command line names no command, or options that the command does not have."""


class Move(Protocol):
    """Moves a progress bar."""

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Show how much is done of a total, with a note beside the bar."""


@contextlib.contextmanager
def progress_bar(name: str) -> Iterator[Move]:
    """Show a progress bar with the time left on stderr; yield the function that moves it."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    share, left = TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn()
    columns = (TextColumn(name), BarColumn(), share, left, TextColumn("{task.fields[note]}"))
    console = Console(stderr=True)
    quiet = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=quiet) as bar:
        task = bar.add_task(name, total=None, note="")

        def move(done: int, total: int, note: str = "") -> None:
            bar.update(task, completed=done, total=total, note=note)

        yield move


def check_json(path: Path | None) -> None:
    """Raise InvalidInputError, before the work is done, if a JSON file cannot be written."""
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise InvalidInputError("--json", str(path), "a file in a folder that exists")


def check_results_folder(out: Path | None) -> None:
    """Refuse, before the work is done, a folder that cannot take the results.

    Raises:
        InvalidInputError: It is not empty, cannot be a folder, or must not be written to.
    """
    from fulcrum.sim.run import check_new_folder

    if out is not None:
        check_new_folder("--out", out)


def results_folder(out: Path | None, name: str) -> Path:
    """Make the folder asked for, or logs/NAME-TIME, which no other process has.

    Raises:
        InvalidInputError: It is not empty, or cannot be made.
    """
    from fulcrum.sim.run import claim_folder

    folder = out or _LOGS / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    try:
        if out is None:
            return claim_folder(folder)
        check_results_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        given = f"{folder} ({error.strerror})"
        raise InvalidInputError("--out", given, "a folder that can be written to") from None
    return folder


@contextlib.contextmanager
def removed_if_empty(folder: Path) -> Iterator[None]:
    """Remove a folder in the end if nothing was written to it; so is logs, if it is the last."""
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # it is gone, or holds something
            folder.rmdir()
            if folder.parent == _LOGS:
                _LOGS.rmdir()
