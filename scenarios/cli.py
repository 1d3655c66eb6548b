"""The command line: ``fulcrum``."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import tyro

from fulcrum.scenarios.commands.check import Check
from fulcrum.scenarios.commands.common import (
    BAD_INPUT,
    INTERRUPTED,
    Chosen,
)
from fulcrum.scenarios.commands.crosscheck import Crosscheck
from fulcrum.scenarios.commands.explain import Capacity, Explain
from fulcrum.scenarios.commands.list import List
from fulcrum.scenarios.commands.new import New
from fulcrum.scenarios.commands.place import Place
from fulcrum.scenarios.commands.plan import Plan
from fulcrum.scenarios.commands.reproduce import Reproduce
from fulcrum.scenarios.commands.run import Run
from fulcrum.scenarios.commands.sweep import Sweep
from fulcrum.scenarios.commands.view import Screenshot, View

if TYPE_CHECKING:
    pass

# Heavy packages are imported by the commands that need them: `fulcrum --help` answers at once.


Command = (
    Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Screenshot, tyro.conf.subcommand("screenshot")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Explain, tyro.conf.subcommand("explain")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[New, tyro.conf.subcommand("new")]
    | Annotated[Capacity, tyro.conf.subcommand("capacity")]
    | Annotated[Place, tyro.conf.subcommand("place")]
    | Annotated[Plan, tyro.conf.subcommand("plan")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Crosscheck, tyro.conf.subcommand("crosscheck")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
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
) -> (
    List
    | Run
    | Screenshot
    | View
    | Explain
    | Check
    | New
    | Capacity
    | Place
    | Plan
    | Reproduce
    | Crosscheck
    | Sweep
):
    """The command asked for; a parse error leaves as one line instead of tyro's box."""
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            return tyro.cli(Command, prog="fulcrum", description=_DESCRIPTION, args=arguments)
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
