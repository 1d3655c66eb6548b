"""The scenarios that ship, by name, and scenarios from files."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from fulcrum.scenarios.reading.file import named_file, read, scene_files
from fulcrum.scenarios.reading.scene import check_scene
from fulcrum.sim.scenario import Scenario


@cache
def scenarios() -> dict[str, Scenario]:
    """Return all scenarios that ship, by name."""
    return {name: read(file) for name, file in scene_files().items()}


def scenario(name_or_file: str | Path, allowed: tuple[Path, ...] = ()) -> Scenario:
    """Return the scenario that ships under a name, or the one of a file.

    Args:
        name_or_file: Name of a scenario, or of a file that ends in ``.toml``.
        allowed: Folders, besides its own, from which the file may read others.

    Raises:
        InvalidInputError: There is none of that name, or the file is not valid.
    """
    known, name = scenarios(), str(name_or_file)
    if name in known:
        return known[name]
    file = named_file("scenario", name)
    found = read(file, allowed)
    check_scene(file, found)
    return found
