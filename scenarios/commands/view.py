"""`fulcrum screenshot` and `fulcrum view`: recordings as pictures, and in the viewer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from fulcrum.scenarios.commands.common import PASSED, MaybePath
from fulcrum.synthesis import InvalidInputError


@dataclass(frozen=True)
class ViewCommand:
    """Open a recording in the Rerun viewer."""

    run: tyro.conf.Positional[Path]
    """Folder of a run, or an .rrd file."""

    def execute(self) -> int:
        """Run the command; return the exit code."""
        from fulcrum.sim.recording import view

        view(self.run)
        return PASSED


@dataclass(frozen=True)
class ScreenshotCommand:
    """Draw one moment of a recording as a PNG picture; needs no screen."""

    run: tyro.conf.Positional[Path]
    """Folder of a run, or an .rrd file."""

    at: float
    """Time of the moment since the start of the run [s]."""

    out: MaybePath = None
    """Picture to write; by default screenshot-AT.png beside the recording."""

    def execute(self) -> int:
        """Run the command; return the exit code."""
        from fulcrum.sim.recording import recording_file, screenshot

        picture = self.out or recording_file(self.run).parent / f"screenshot-{self.at:g}.png"
        if not picture.parent.is_dir():
            raise InvalidInputError("--out", str(picture), "a file in a folder that exists")
        screenshot(self.run, self.at, picture)
        print(picture)
        return PASSED
