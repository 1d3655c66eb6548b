"""The command line: ``fulcrum``."""

from __future__ import annotations

import contextlib
import io
import platform
import re
import sys
import traceback
from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import Annotated, Any, Protocol

import tyro

from fulcrum.scenarios.commands.check import CheckCommand
from fulcrum.scenarios.commands.common import (
    BAD_INPUT,
    BUG,
    INTERRUPTED,
    PASSED,
    Chosen,
    CommandLineError,
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
from fulcrum.synthesis import FulcrumError

# Heavy packages are imported by the commands that need them: `fulcrum --help` answers at once.

COMMANDS = {
    "list": ListCommand,
    "run": RunCommand,
    "screenshot": ScreenshotCommand,
    "view": ViewCommand,
    "explain": ExplainCommand,
    "check": CheckCommand,
    "new": NewCommand,
    "capacity": CapacityCommand,
    "place": PlaceCommand,
    "plan": PlanCommand,
    "reproduce": ReproduceCommand,
    "crosscheck": CrosscheckCommand,
    "sweep": SweepCommand,
}
AnyCommand: Any = reduce(
    or_, (Annotated[kind, tyro.conf.subcommand(name)] for name, kind in COMMANDS.items())
)


class Executable(Protocol):
    """A command with its options."""

    def execute(self) -> int:
        """Run the command; return the exit code."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code.

    0 pass, 1 failed its checks, 2 bad input, 70 a bug, 130 interrupted.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    command: Executable | None = None
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
        if not isinstance(error, (FulcrumError, OSError)):
            traceback.print_exc()
            print("fulcrum: this is a bug; please report the lines above.", file=sys.stderr)
            return BUG
        text = command.told(error) if isinstance(command, Chosen) else str(error)
        print(f"fulcrum: {' '.join(text.split())}", file=sys.stderr)
        return BAD_INPUT


def _parse(arguments: Sequence[str]) -> Executable:
    """Return the command asked for, or print the help; a parse error is raised as one line."""
    errors = io.StringIO()
    try:
        with contextlib.redirect_stderr(errors):
            command: Executable = tyro.cli(
                AnyCommand,
                prog="fulcrum",
                description=_DESCRIPTION,
                args=arguments or ["--help"],
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone),
            )
            return command
    except SystemExit as stop:
        if stop.code == 0:
            raise
        boxed = re.split(r"─{5,}", errors.getvalue())
        words = re.sub(r"[│╭╮╰╯─\s]+", " ", boxed[1] if len(boxed) > 1 else errors.getvalue())
        # tyro says of a missing option what it is for, and of a wrong value how it is parsed.
        words = re.sub(r"^ Missing from [a-z ]+: (\S+) .*", r"\1 is missing", words)
        wrong = r"Error parsing (\S+): no type matching \{?(.*?)\}? could .* from \[(.*?)\]\. .*"
        words = re.sub(wrong, r"\1: got \3; valid is \2", words).strip(" .")
        described = [word for word in arguments[:1] if word in COMMANDS]
        help_line = " ".join(["fulcrum", *described, "--help"])
        raise CommandLineError(f"{words}; see `{help_line}`.") from None


_DESCRIPTION = (
    "Robots move objects too heavy to lift by leaning them on their surroundings: contact force "
    "synthesis in a MuJoCo closed loop, recorded and judged. `fulcrum --version` prints the "
    "versions of fulcrum and of the packages that its numbers depend on."
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
