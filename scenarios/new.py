"""The command that begins a scenario file: ``fulcrum new``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from scenarios.common import PASSED

# Names that commands, folders and recordings take as they are.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class New:
    """Write a scenario file that explains its keys; by default a box that is held by Baxter."""

    name: tyro.conf.Positional[str]
    """Of the scenario; NAME.toml is written. It may be in a folder that exists."""

    origin: Annotated[str | None, tyro.conf.arg(name="from")] = None
    """Another scenario to begin with: a name (see `fulcrum list`), or a file ending in .toml."""

    allow_path: tyro.conf.UseAppendAction[tuple[Path, ...]] = field(default=(), kw_only=True)
    """Folder besides its own from which the file may have meshes and robots read."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from scenarios.file import SCHEMA, SUFFIX, made, open_source
        from scenarios.file_errors import Source
        from scenarios.file_writer import write
        from synthesis.errors import InvalidInputError

        file = Path(self.name.removesuffix(SUFFIX) + SUFFIX)
        if not _NAME.fullmatch(file.stem):
            valid = "a name of letters, digits, - and _ that begins with a letter or a digit"
            raise InvalidInputError("name", self.name, valid)
        if not file.parent.is_dir():
            raise InvalidInputError("name", self.name, "one in a folder that exists")
        if file.exists():
            raise InvalidInputError("name", self.name, f"another one, as {file} exists")
        text = write(open_source(self._origin()).data, SCHEMA.as_uri())
        made(Source(file, text), self.allow_path)  # what it names may not be there
        file.write_text(text, encoding="utf-8")
        print(f"{file}: see what `fulcrum check {file}` says of it.")
        return PASSED

    def _origin(self) -> Path:
        """The file to begin with."""
        from scenarios.file import SUFFIX, TEMPLATE, scene_files
        from scenarios.file_errors import nearest
        from synthesis.errors import InvalidInputError

        if self.origin is None:
            return TEMPLATE
        shipped = scene_files()
        if self.origin in shipped:
            return shipped[self.origin]
        if not self.origin.endswith(SUFFIX):
            valid = f"{nearest(self.origin, list(shipped))}, or a file ending in {SUFFIX}"
            raise InvalidInputError("--from", self.origin, valid)
        return Path(self.origin)
