"""Walks the JSON Schema of scenario files: which tables may stand at a key, and their keys."""

from __future__ import annotations

from functools import cache
from typing import Any

from pydantic import TypeAdapter

from fulcrum.scenarios.schema.tables import LiftedFile, ScenarioFile

Schema = dict[str, Any]


@cache
def json_schema() -> Schema:
    """Return the JSON Schema of scenario files, as pydantic makes it."""
    return TypeAdapter(ScenarioFile | LiftedFile).json_schema()


def options(value: Schema) -> list[Schema]:
    """Return what a value may be: references are followed, unions taken apart, null left out."""
    if "$ref" in value:
        return options(json_schema()["$defs"][value["$ref"].rpartition("/")[2]])
    for union in ("anyOf", "oneOf"):
        if union in value:
            return [option for part in value[union] for option in options(part)]
    return [] if value.get("type") == "null" else [value]


def items(value: Schema) -> Schema | None:
    """Return the schema of what a list holds, or a table with names of one's own; else None."""
    named = [*value.get("patternProperties", {}).values(), value.get("additionalProperties")]
    return value["items"] if "items" in value else named[0] or None


def tables(value: Schema) -> list[Schema]:
    """Return the tables with known keys that a value may be."""
    return [option for option in options(value) if "properties" in option]


def table_at(kind: str, loc: tuple[str | int, ...]) -> Schema:
    """Return the table in which a location ends, in a file of a kind."""
    reached = [{"$ref": kind}]
    for part in loc[:-1]:
        # A tag names no more than which of the union's members it is: nothing is under it.
        reached = [inner for value in reached for inner in _under(value, part)] or reached
    found = [table for value in reached for table in tables(value)]
    return next((table for table in found if tags(table) & set(loc)), found[0])


def _under(value: Schema, part: str | int) -> list[Schema]:
    """Return what a key or an index leads to."""
    found = []
    for option in options(value):
        inner = option.get("properties", {}).get(part)
        if inner is None and isinstance(part, int) == ("items" in option):
            inner = items(option)
        found += [] if inner is None else [inner]
    return found


def tags(table: Schema) -> set[str]:
    """Return the shapes or kinds that say which table it is."""
    keys = (table["properties"].get(name, {}) for name in ("shape", "kind"))
    return {tag for key in keys for tag in (key.get("const"), *key.get("enum", ())) if tag}
