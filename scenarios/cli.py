"""The command line: ``fulcrum``."""

from __future__ import annotations

import contextlib
import io
import platform
import re
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import tyro

from fulcrum.scenarios.commands.check import CheckCommand
from fulcrum.scenarios.commands.common import (
    BAD_INPUT,
    BUG,
    INTERRUPTED,
    PASSED,
    Chosen,
)
from fulcrum.scenarios.commands.crosscheck import CrosscheckCommand
from fulcrum.scenarios.commands.explain import CapacityCommand, ExplainCommand
from fulcrum.scenarios.commands.list import ListCommand
from fulcrum.scenarios.commands.new import NewCommand
from fulcrum.scenarios.commands.place import PlaceCommand
from fulcrum.scenarios.commands.plan import PlanCommand
from fulcrum.scenarios.commands.reproduce import ReproduceCommand
from fulcrum.scenarios.commands.run import RunCommand
from fulcrum.scenarios.commands.sweep import SweepCommand
from fulcrum.scenarios.commands.view import ScreenshotCommand, ViewCommand

# Heavy packages are imported by the commands that need them: `fulcrum --help` answers at once.


AnyCommand = (
    Annotated[ListCommand, tyro.conf.subcommand("list")]
    | Annotated[RunCommand, tyro.conf.subcommand("run")]
    | Annotated[ScreenshotCommand, tyro.conf.subcommand("screenshot")]
    | Annotated[ViewCommand, tyro.conf.subcommand("view")]
    | Annotated[ExplainCommand, tyro.conf.subcommand("explain")]
    | Annotated[CheckCommand, tyro.conf.subcommand("check")]
    | Annotated[NewCommand, tyro.conf.subcommand("new")]
    | Annotated[CapacityCommand, tyro.conf.subcommand("capacity")]
    | Annotated[PlaceCommand, tyro.conf.subcommand("place")]
    | Annotated[PlanCommand, tyro.conf.subcommand("plan")]
    | Annotated[ReproduceCommand, tyro.conf.subcommand("reproduce")]
    | Annotated[CrosscheckCommand, tyro.conf.subcommand("crosscheck")]
    | Annotated[SweepCommand, tyro.conf.subcommand("sweep")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code.

    0 pass, 1 failed its checks, 2 bad input, 70 a bug, 130 interrupted.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    command = None
    try:
        if list(arguments) == ["--version"]:
            print(_versions())
            return PASSED
        command = _parse(arguments)
        return command.execute()
    except KeyboardInterrupt:  # a run that has begun catches it itself
        print("fulcrum: interrupted.", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        from fulcrum.synthesis import FulcrumError

        if not isinstance(error, (FulcrumError, OSError)):
            traceback.print_exc()
            print("fulcrum: this is a bug; please report the lines above.", file=sys.stderr)
            return BUG
        text = command.told(error) if isinstance(command, Chosen) else str(error)
        print(f"fulcrum: {' '.join(text.split())}", file=sys.stderr)
        return BAD_INPUT


def _parse(
    arguments: Sequence[str],
) -> AnyCommand:
    """Return the command asked for, with none the help; a parse error becomes one line."""
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            return tyro.cli(
                AnyCommand, prog="fulcrum", description=_DESCRIPTION, args=arguments or ["--help"]
            )
    except SystemExit as stop:
        if stop.code == 0:
            raise
        from fulcrum.synthesis import InvalidInputError

        boxed = re.split(r"─{5,}", errors.getvalue())
        words = re.sub(r"[│╭╮╰╯─\s]+", " ", boxed[1] if len(boxed) > 1 else errors.getvalue())
        raise InvalidInputError("command line", words.strip(), "as `fulcrum --help` says") from None


_DESCRIPTION = (
    "Robots move objects too heavy to lift by leaning them on their surroundings: contact force "
    "synthesis in a MuJoCo closed loop, recorded and checked. `fulcrum --version` prints the "
    "versions of fulcrum and of what its numbers depend on."
)
# Whose versions a report of a bug needs.
_PACKAGES = ("mujoco", "dm-control", "clarabel", "pin", "mink", "rerun-sdk")


def _versions() -> str:
    """Return the versions of fulcrum, Python and the packages that do the work, one a line."""
    from importlib.metadata import version

    import fulcrum

    own = {"fulcrum": fulcrum.__version__, "Python": platform.python_version()}
    return "\n".join(
        f"{name} {number}" for name, number in (own | {p: version(p) for p in _PACKAGES}).items()
    )


if __name__ == "__main__":
    sys.exit(main())
