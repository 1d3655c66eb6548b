"""`fulcrum new`: a scenario file to start from."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from fulcrum.scenarios.commands.common import PASSED, MaybeNumber
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import positive

# How far a table reaches beyond the box [m]; at the sides it leaves room for wrists.
_MARGIN, _MARGIN_ASIDE = 0.05, 0.04
# Names that need no quotes in commands, folders and recordings.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class NewCommand:
    """Write a scenario file with a comment on every key; by default Baxter tilting a box."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """Name of the scenario, perhaps with an existing folder before it; NAME.toml is written."""

    origin: Annotated[
        str | None, tyro.conf.arg(name="from", metavar="SCENARIO", help_behavior_hint="")
    ] = None
    """Scenario to copy instead: a name (see `fulcrum list`), or a file ending in .toml."""

    size: Annotated[
        tuple[float, float, float] | None, tyro.conf.arg(metavar="X Y Z", help_behavior_hint="")
    ] = None
    """Lengths of the box [m]; it turns about its near lower edge, on a table made to fit."""

    weight: MaybeNumber = None
    """Weight of the box [N]."""

    friction: Annotated[
        tuple[float, float] | None, tyro.conf.arg(metavar="HANDS EDGE", help_behavior_hint="")
    ] = None
    """Friction coefficients of the box, at the hands and at the edge [-]."""

    allow_path: tyro.conf.UseAppendAction[tuple[Path, ...]] = field(default=(), kw_only=True)
    """Folder, besides its own, from which the scenario file may read meshes and robots."""

    def execute(self) -> int:
        """Run the command; return the exit code."""
        from fulcrum.scenarios.reading.file import SCHEMA, SUFFIX, bring_schema, made, open_source
        from fulcrum.scenarios.reading.source import Source
        from fulcrum.scenarios.schema.writer import write

        file = Path(self.name.removesuffix(SUFFIX) + SUFFIX)
        if not _NAME.fullmatch(file.stem):
            valid = "a name of letters, digits, - and _ that begins with a letter or a digit"
            raise InvalidInputError("name", self.name, valid)
        if not file.parent.is_dir():
            raise InvalidInputError("name", self.name, "a name in a folder that exists")
        if file.exists():
            raise InvalidInputError("name", self.name, f"a new name, as {file} exists")
        data = open_source(self._origin()).data
        self._change(data)
        text = write(data, SCHEMA.name)
        made(Source(file, text), self.allow_path)  # what it names may not be there
        bring_schema(file.parent)
        file.write_text(text, encoding="utf-8")
        print(f"{file} is written; next: fulcrum check {file}")
        return PASSED

    def _change(self, data: dict[str, Any]) -> None:
        """Change the template to another box: the edge stays where it is, on a table to fit."""
        asked = {"--size": self.size, "--weight": self.weight, "--friction": self.friction}
        for option, value in asked.items():
            if value is not None and self.origin is not None:
                raise InvalidInputError(
                    option, value, "left out with --from: edit the new file instead"
                )
            for number in (value,) if isinstance(value, float) else value or ():
                positive(option, number)
        if self.origin is not None:
            return
        box, table = data["object"], data["environment"]["table"]
        if self.size is not None:
            x, y, z = self.size
            edge = box["position_m"][0] - box["size_m"][0] / 2
            box["size_m"], box["position_m"] = [x, y, z], [_short(edge + x / 2), 0.0, z / 2]
            # The box lies on one side of the edge, and stands on the other in the end.
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
        """Return the file to start from."""
        from fulcrum.scenarios.reading.file import TEMPLATE, named_file

        return TEMPLATE if self.origin is None else named_file("--from", self.origin)


def _short(length: float) -> float:
    """Return a length without rounding errors."""
    return round(length, 9)
