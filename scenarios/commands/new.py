"""The command that begins a scenario file: ``fulcrum new``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from fulcrum.scenarios.commands.common import PASSED

# Of a table about what lies on it [m]; aside it has to leave room for wrists.
_MARGIN, _MARGIN_ASIDE = 0.05, 0.04
# Names that commands, folders and recordings take as they are.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class NewCommand:
    """Write a scenario file that explains its keys; by default a box that is held by Baxter."""

    name: tyro.conf.Positional[str]
    """Of the scenario; NAME.toml is written. It may be in a folder that exists."""

    origin: Annotated[str | None, tyro.conf.arg(name="from")] = None
    """Another scenario to begin with: a name (see `fulcrum list`), or a file ending in .toml."""

    size: tuple[float, float, float] | None = None
    """Of the box that it begins with [m]: along x, y and z; it turns about its near edge."""

    weight: float | None = None
    """Of that box [N]."""

    friction: tuple[float, float] | None = None
    """Of that box: at the hands, and at the edge [-]."""

    allow_path: tyro.conf.UseAppendAction[tuple[Path, ...]] = field(default=(), kw_only=True)
    """Folder besides its own from which the file may have meshes and robots read."""

    def execute(self) -> int:
        """Does it; returns the exit code."""
        from fulcrum.scenarios.reading.file import SCHEMA, SUFFIX, bring_schema, made, open_source
        from fulcrum.scenarios.reading.source import Source
        from fulcrum.scenarios.schema.writer import write
        from fulcrum.synthesis import InvalidInputError

        file = Path(self.name.removesuffix(SUFFIX) + SUFFIX)
        if not _NAME.fullmatch(file.stem):
            valid = "a name of letters, digits, - and _ that begins with a letter or a digit"
            raise InvalidInputError("name", self.name, valid)
        if not file.parent.is_dir():
            raise InvalidInputError("name", self.name, "one in a folder that exists")
        if file.exists():
            raise InvalidInputError("name", self.name, f"another one, as {file} exists")
        data = open_source(self._origin()).data
        self._change(data)
        text = write(data, SCHEMA.name)
        made(Source(file, text), self.allow_path)  # what it names may not be there
        bring_schema(file.parent)
        file.write_text(text, encoding="utf-8")
        print(f"{file}: see what `fulcrum check {file}` says of it.")
        return PASSED

    def _change(self, data: dict[str, Any]) -> None:
        """Makes the template that of another box: the edge stays where it is, on a table to fit."""
        from fulcrum.synthesis import InvalidInputError
        from fulcrum.synthesis.checks import positive

        asked = {"--size": self.size, "--weight": self.weight, "--friction": self.friction}
        for option, value in asked.items():
            if value is not None and self.origin is not None:
                valid = "left out with --from: what is written says it"
                raise InvalidInputError(option, value, valid)
            for number in (value,) if isinstance(value, float) else value or ():
                positive(option, number)
        if self.origin is not None:
            return
        box, table = data["object"], data["environment"]["table"]
        if self.size is not None:
            x, y, z = self.size
            edge = box["position_m"][0] - box["size_m"][0] / 2
            box["size_m"], box["position_m"] = [x, y, z], [_short(edge + x / 2), 0.0, z / 2]
            # It lies on one side of the edge, and stands on the other.
            room = (x + z + 2 * _MARGIN, y + _MARGIN_ASIDE, table["size_m"][2])
            table["size_m"] = [_short(length) for length in room]
            table["position_m"] = [_short(edge + (x - z) / 2), 0.0, 0.0]
        if self.weight is not None:
            box["weight_n"] = self.weight
        if self.friction is not None:
            at_hands, at_edge = self.friction
            table["friction"]["mu"] = at_edge
            for hand in data["hands"].values():
                hand["friction"]["mu"] = at_hands

    def _origin(self) -> Path:
        """The file to begin with."""
        from fulcrum.scenarios.reading.file import TEMPLATE, named_file

        return TEMPLATE if self.origin is None else named_file("--from", self.origin)


def _short(length: float) -> float:
    """A length without what rounding adds to it."""
    return round(length, 9)
