"""Reads scenario files: TOML with a published schema.

A file runs no code, and reads other files only in its folder and where the command line allows it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from fulcrum.scenarios.reading.access import Access
from fulcrum.scenarios.reading.build import build
from fulcrum.scenarios.reading.places import vector
from fulcrum.scenarios.reading.source import FileError, Source, explained, nearest
from fulcrum.scenarios.schema.kinds import FileTable
from fulcrum.scenarios.schema.tables import LiftedFile, ScenarioFile
from fulcrum.scenarios.schema.walk import json_schema
from fulcrum.sim.scenario import HOLD, Pivot, Scenario, lifted, tilting
from fulcrum.synthesis import InvalidInputError

SUFFIX = ".toml"
SCENES = Path(__file__).resolve().parents[1] / "scenes"
TEMPLATE = Path(__file__).resolve().parents[1] / "template.toml"
SCHEMA = SCENES / "scenario.schema.json"
# Longer files are no scenarios [bytes].
_LONGEST = 2_000_000
_TITLE = "fulcrum scenario"


def read(file: Path, allowed: tuple[Path, ...] = ()) -> Scenario:
    """Return the scenario of a file, named as the file is.

    Args:
        file: Scenario file.
        allowed: Folders, besides its own, from which it may read other files.

    Raises:
        FileError: It is not valid; says where and why.
    """
    return made(open_source(file), allowed)


def made(source: Source, allowed: tuple[Path, ...] = ()) -> Scenario:
    """Return the scenario of a text, as :func:`read` does of its file.

    Raises:
        FileError: It is not valid; says where and why.
    """
    if "lifted_from" in source.data:
        return _lifted(source, _validated(source, LiftedFile), allowed)
    return build(source, _validated(source, ScenarioFile), Access(source, allowed))


def open_source(file: Path) -> Source:
    """Return the text of a file.

    Raises:
        FileError: It cannot be read, or is not TOML.
    """
    valid = f"a scenario file, like those that `fulcrum new` writes, with the ending {SUFFIX}"
    try:
        if file.stat().st_size > _LONGEST:
            raise FileError(file, None, "", f"{file.stat().st_size} bytes", valid)
        return Source(file, file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise FileError(file, None, "", error.strerror or str(error), valid) from None
    except ValueError as error:  # no UTF-8, or a name with a zero in it
        if isinstance(error, FileError):
            raise
        raise FileError(file, None, "", "text that is not UTF-8", valid) from None


Model = TypeVar("Model", bound=FileTable)


def _validated(source: Source, model: type[Model]) -> Model:
    try:
        return model.model_validate(source.data)
    except ValidationError as error:
        raise explained(source, model.__name__, error) from None


def _lifted(source: Source, table: LiftedFile, allowed: tuple[Path, ...]) -> Scenario:
    """Return the other scenario without its supports."""
    key = ("lifted_from",)
    shipped = scene_files()
    if table.lifted_from in shipped:
        other = shipped[table.lifted_from]
    elif table.lifted_from.endswith(SUFFIX):
        other = Access(source, allowed).file(key, table.lifted_from, "a scenario file")
    else:
        raise source.error(key, f'"{table.lifted_from}"', valid_names(table.lifted_from))
    if "lifted_from" in open_source(other).data:
        raise source.error(key, f'"{table.lifted_from}"', "a scenario without lifted_from")
    scenario = lifted(read(other, allowed))
    path, phases = scenario.path, scenario.phases
    if not isinstance(path, Pivot):
        raise source.error(key, f'"{table.lifted_from}"', "a scenario with a tilt or a screw")
    if table.after == "hold":
        last = max(tilting(phases))
        phases = (*phases[: last + 1], *HOLD)
    return replace(
        scenario,
        name=source.file.stem,
        summary=table.summary,
        path=replace(path, travel=vector(table.travel_m)),
        phases=phases,
    )


def scene_files() -> dict[str, Path]:
    """Return the files of the scenes that ship, by name."""
    return {path.stem: path for path in sorted(SCENES.glob(f"*{SUFFIX}"))}


def named_file(field: str, name: str) -> Path:
    """Return the file of a scenario that ships by its name, or of another one by its path.

    Raises:
        InvalidInputError: It is neither; names the field in which it was given.
    """
    shipped = scene_files()
    if name in shipped:
        return shipped[name]
    if not name.endswith(SUFFIX):
        raise InvalidInputError(field, name, valid_names(name))
    return Path(name)


def valid_names(word: str) -> str:
    """Return the valid names of scenarios, those like a word first."""
    return f"{nearest(word, list(scene_files()))}, or a file ending in {SUFFIX}"


def bring_schema(folder: Path) -> None:
    """Copy the schema into a folder, where editors find it by its name alone.

    A file of that name that is no such schema stays as it is.
    """
    copy, text = folder / SCHEMA.name, SCHEMA.read_text(encoding="utf-8")
    if copy.resolve() == SCHEMA:
        return
    if not copy.exists() or _TITLE in copy.read_text(encoding="utf-8", errors="replace"):
        copy.write_text(text, encoding="utf-8")


def schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files."""
    made = json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": _TITLE,
        **_named_infinities(made),
    }


def _named_infinities(value: Any) -> Any:
    """Return a value with infinite numbers, which JSON does not know, as TOML writes them."""
    if isinstance(value, dict):
        return {key: _named_infinities(item) for key, item in value.items()}
    return "inf" if value == math.inf else value
