"""What the commands share: exit codes, the choice of a controller, progress, output files."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

import tyro

if TYPE_CHECKING:
    from fulcrum.sim.planning import Planning
    from fulcrum.sim.plant import Engine
    from fulcrum.sim.scenario import Control, Scenario

Choice = TypeVar("Choice", bound=StrEnum)

PASSED, FAILED, BAD_INPUT, BUG, INTERRUPTED = 0, 1, 2, 70, 130

# Where runs and sweeps without a folder of their own are kept.
_LOGS = Path("logs")


@dataclass(frozen=True)
class Chosen:
    """What every command on a scenario is told."""

    scenario: tyro.conf.Positional[str]
    """Name of a scenario (see `fulcrum list`), or a file ending in .toml (see `fulcrum new`)."""

    allow_path: tyro.conf.UseAppendAction[tuple[Path, ...]] = field(default=(), kw_only=True)
    """Folder besides its own from which the file may have meshes and robots read."""

    def chosen(self) -> Scenario:
        """The scenario.

        Raises:
            InvalidInputError: There is none of that name, or the file is not valid.
        """
        from fulcrum.scenarios.reading.library import scenario

        return scenario(self.scenario, self.allow_path)

    def told(self, error: Exception) -> str:
        """An error as a sentence, with the scenario's file, if it has one, and what may help."""
        from fulcrum.scenarios.reading.file import SUFFIX, open_source
        from fulcrum.scenarios.reading.source import FileError
        from fulcrum.sim.motion import PathError
        from fulcrum.synthesis import InvalidInputError

        of_an_option = isinstance(error, InvalidInputError) and error.field.startswith("--")
        named = isinstance(error, (FileError, OSError)) or of_an_option
        if not self.scenario.endswith(SUFFIX) or named:
            return str(error)
        if not isinstance(error, PathError):
            return f"{self.scenario}: {error}"
        line = open_source(Path(self.scenario)).line(("path",))
        return (
            f"{self.scenario}:{line}: path: {str(error).rstrip('.')}; "
            f"`fulcrum place {self.scenario}` seeks places for object, robots and hands that can."
        )

    @property
    def words(self) -> list[str]:
        """How a command line names it."""
        allowed = [("--allow-path", str(folder)) for folder in self.allow_path]
        return [self.scenario, *itertools.chain.from_iterable(allowed)]


def chosen_control(scenario: Scenario, controller: str, objective: str | None) -> Control:
    """The scenario's control of a name, with another objective if one is given.

    Raises:
        InvalidInputError: There is no such controller or objective.
    """
    from fulcrum.sim.scenario import controller as named
    from fulcrum.synthesis import Objective

    control = named(scenario.control, controller, "--controller")
    if objective is None:
        return control
    return replace(control, objective=one_of(Objective, "--objective", objective))


def one_of(kind: type[Choice], option: str, text: str) -> Choice:
    """The member of an enumeration that an option names.

    Raises:
        InvalidInputError: It names none.
    """
    from fulcrum.synthesis import InvalidInputError

    if text not in list(kind):
        raise InvalidInputError(option, text, f"one of {', '.join(kind)}")
    return kind(text)


def chosen_engine(name: str) -> Engine:
    """Return the engine that ``--engine`` names.

    Raises:
        InvalidInputError: It names none, or one that is not installed.
    """
    from fulcrum.sim.plant import Engine, check_installed

    engine = one_of(Engine, "--engine", name)
    check_installed(engine)
    return engine


def chosen_planning(
    scenario: Scenario, plan: str | None, stretch: float, duration: float | None, robust: bool
) -> Planning | None:
    """How the tilt is planned; None if it is not.

    Raises:
        InvalidInputError: There is no such plan, or none to be stretched or made robust.
    """
    from fulcrum.synthesis import InvalidInputError

    if plan is not None:
        return asked_planning(scenario, "--plan", plan, stretch, duration, robust)
    for option, given, default in (("--stretch", stretch, 1.0), ("--robust", robust, False)):
        if given != default:
            raise InvalidInputError(option, given, "given with --plan")
    return None


def asked_planning(
    scenario: Scenario,
    option: str,
    objective: str,
    stretch: float,
    duration: float | None,
    robust: bool,
    points: int = 100,
) -> Planning:
    """A plan as it is asked for; with the scenario's own duration if the objective needs one.

    Raises:
        InvalidInputError: There is no such plan.
    """
    from fulcrum.sim.planning import Planning
    from fulcrum.sim.scenario import tilting
    from fulcrum.synthesis.path import PathObjective

    kind = one_of(PathObjective, option, objective)
    if duration is None:
        own = sum(scenario.phases[i].duration_s for i in tilting(scenario.phases))
        duration = own if kind.needs_duration else math.inf
    return Planning(stretch, points, kind, duration, robust)


class Move(Protocol):
    """Moves a progress bar to what is done of a total; a note stands beside it."""

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Moves it."""


@contextlib.contextmanager
def progress_bar(name: str) -> Iterator[Move]:
    """A progress bar with time left, on stderr; yields the function that moves it."""
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
    """Raises InvalidInputError before the work is done if a JSON file could not be written."""
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        from fulcrum.synthesis import InvalidInputError

        raise InvalidInputError("--json", str(path), "a file in a folder that exists")


def check_results_folder(out: Path | None) -> None:
    """Refuse, before the work is done, a folder that cannot take the results.

    Raises:
        InvalidInputError: It is not empty, or cannot be a folder, or must not be written to.
    """
    from fulcrum.sim.run import check_new_folder

    if out is not None:
        check_new_folder("--out", out)


def results_folder(out: Path | None, name: str) -> Path:
    """Make the folder asked for, or logs/NAME-TIME, which no other process has.

    Raises:
        InvalidInputError: It is not empty, or cannot be made.
    """
    from fulcrum.sim.run import check_new_folder, claim_folder
    from fulcrum.synthesis import InvalidInputError

    folder = out or _LOGS / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    try:
        if out is None:
            return claim_folder(folder)
        check_new_folder("--out", folder)
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
