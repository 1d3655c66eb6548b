"""Writes a scenario file with every key explained in a comment, from its JSON Schema."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from typing import Any

from fulcrum.scenarios.schema.walk import Schema, items, json_schema, options, tables, tags

_WIDTH = 100
# Keys that the file leaves out are written behind this, ready to be used.
_OFF = "#"
_JOINT = "some_joint"


def write(data: Mapping[str, Any], schema: str) -> str:
    """Return the text of a scenario file that says what the data says.

    Keys that the data leaves out are written as comments, with their default values.

    Args:
        data: Content of a scenario file, as tomllib reads it.
        schema: Where editors find the JSON Schema.
    """
    kind = json_schema()["$defs"]["LiftedFile" if "lifted_from" in data else "ScenarioFile"]
    lines = [f"#:schema {schema}", *_comment(kind), ""]
    return "\n".join([*lines, *_Writer().table(kind, data, (), explained=True)]) + "\n"


class _Writer:
    """Writes tables; of several of a kind, only the first is explained."""

    def __init__(self) -> None:
        self._explained: set[str] = set()

    def table(
        self, table: Schema, data: Mapping[str, Any] | None, path: tuple[str, ...], explained: bool
    ) -> list[str]:
        """Return the keys of a table, then the tables in it; without data, all as comments."""
        lines: list[str] = []
        inner: list[str] = []
        required = table.get("required", [])
        # Required keys come first.
        for name, key in sorted(table["properties"].items(), key=lambda k: k[0] not in required):
            value = None if data is None else data.get(name)
            comment = _comment(key) if explained else []
            form = options(key)[0]
            item = items(form)
            if found := tables(key if item is None else item):
                inner += self._inner(form, found, value, (*path, name), comment)
            elif isinstance(value, Mapping):
                inner += [*_comment(key), f"[{'.'.join((*path, name))}]"]
                inner += [*(f"{own} = {_text(item)}" for own, item in value.items()), ""]
            elif explained or value is not None:
                off, shown = (_OFF, _default(key)) if value is None else ("", value)
                lines += [*comment, f"{off}{name} = {_text(shown)}", *([""] if explained else [])]
        return [*lines, *([] if explained else [""]), *inner]

    def _inner(
        self,
        form: Schema,
        found: list[Schema],
        value: Any,
        path: tuple[str, ...],
        comment: list[str],
    ) -> list[str]:
        """Return the tables of a key: one, several by name, or several in a row."""
        own = ".".join(path)
        if "properties" in form:
            if value is None and not comment:
                return []
            return [
                *comment,
                f"{_OFF if value is None else ''}[{own}]",
                *self._once(found, value, path),
            ]
        if not value:
            return []
        if "items" in form:
            named = [(f"[[{own}]]", item, path) for item in value]
        else:
            named = [(f"[{own}.{name}]", item, (*path, name)) for name, item in value.items()]
        lines = (line for head, *item in named for line in (head, *self._once(found, *item)))
        return [*comment, *lines]

    def _once(self, found: list[Schema], item: Any, path: tuple[str, ...]) -> list[str]:
        """Return a table, explained if none of its kind has been."""
        given = set() if item is None else {item.get("shape"), item.get("kind", "tilt")}
        table = next((table for table in found if tags(table) & given), found[0])
        explained = table["title"] not in self._explained
        self._explained.add(table["title"])
        return self.table(table, item, path, explained)


def _default(key: Schema) -> Any:
    """Return the default, or an example where there is none."""
    default = key.get("default")
    return _example(key) if default in (None, [], {}) else default


def _example(value: Schema) -> Any:
    """Return a value that may stand there."""
    kind = options(value)[0]
    for examples in (kind.get("examples"), kind.get("enum")):
        if examples:
            return examples[0]
    inner = items(kind)
    match kind["type"]:
        case "array":
            return [_example(inner or {})]
        case "object":
            return {_JOINT: _example(inner or {})}
        case "number":
            return 1.0
        case _:
            return _JOINT


def _comment(value: Schema) -> list[str]:
    words = " ".join(value.get("description", "").split())
    return textwrap.wrap(words, _WIDTH, initial_indent="# ", subsequent_indent="# ")


def _text(value: Any) -> str:
    """Return a value in TOML."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{name} = {_text(item)}' for name, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
