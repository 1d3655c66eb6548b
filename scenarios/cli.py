"""The command line: ``fulcrum``."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from fulcrum.scenarios.commands.check import CheckCommand
from fulcrum.scenarios.commands.common import (
    BAD_INPUT,
    INTERRUPTED,
    Chosen,
)
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
    | Annotated[SweepCommand, tyro.conf.subcommand("sweep")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit code.

    0 pass, 1 failed its checks, 2 bad input, 130 interrupted.
    """
    command = None
    try:
        command = _parse(arguments)
        return command.execute()
    except KeyboardInterrupt:  # a run that has begun catches it itself
        print("fulcrum: interrupted.", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        from fulcrum.synthesis.errors import FulcrumError

        if not isinstance(error, (FulcrumError, OSError)):
            raise
        text = command.told(error) if isinstance(command, Chosen) else str(error)
        print(f"fulcrum: {' '.join(text.split())}", file=sys.stderr)
        return BAD_INPUT


def _parse(
    arguments: Sequence[str] | None,
) -> AnyCommand:
    """The command asked for; a parse error leaves as one line instead of tyro's box."""
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            return tyro.cli(AnyCommand, prog="fulcrum", description=_DESCRIPTION, args=arguments)
    except SystemExit as stop:
        if stop.code == 0:
            raise
        from fulcrum.synthesis.errors import InvalidInputError

        boxed = re.split(r"─{5,}", errors.getvalue())
        words = re.sub(r"[│╭╮╰╯─\s]+", " ", boxed[1] if len(boxed) > 1 else errors.getvalue())
        raise InvalidInputError("command line", words.strip(), "as `fulcrum --help` says") from None


_DESCRIPTION = (
    "Robots move objects too heavy to lift by leaning them on their surroundings: contact force "
    "synthesis in a MuJoCo closed loop, recorded and checked."
)


if __name__ == "__main__":
    sys.exit(main())
