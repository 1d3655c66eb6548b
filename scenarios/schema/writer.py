"""Writes a scenario file with every key explained in a comment, from the models' docstrings."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from fulcrum.scenarios.schema.tables import LiftedFile, ScenarioFile
from fulcrum.scenarios.schema.walk import members, tables, tags

_WIDTH = 100
# Keys that the file leaves out stand there behind this, ready to be used.
_OFF = "#"
_JOINT = "some_joint"


def write(data: Mapping[str, Any], schema: str) -> str:
    """The text of a scenario file that says what the data says.

    Keys that it leaves out are there as comments, with their default values.

    Args:
        data: As tomllib reads it.
        schema: Where editors find the JSON Schema.
    """
    model = LiftedFile if "lifted_from" in data else ScenarioFile
    lines = [f"#:schema {schema}", *_comment(model.__doc__ or "")]
    return "\n".join([*lines, "", *_Writer().table(model, data, (), explained=True)]) + "\n"


class _Writer:
    """Writes tables; of several of a kind, only the first is explained."""

    def __init__(self) -> None:
        self._explained: set[type[BaseModel]] = set()

    def table(
        self,
        model: type[BaseModel],
        data: Mapping[str, Any] | None,
        path: tuple[str, ...],
        explained: bool,
    ) -> list[str]:
        """The keys of a table, then the tables in it; without data, all as comments."""
        lines: list[str] = []
        inner: list[str] = []
        # What has to be said comes first.
        for name, field in sorted(
            model.model_fields.items(), key=lambda item: not item[1].is_required()
        ):
            value = None if data is None else data.get(name)
            found = tables(_parts(field))
            if isinstance(value, Mapping) and not found:
                inner += [*_comment(field.description or ""), f"[{'.'.join((*path, name))}]"]
                inner += [*(f"{key} = {_text(item)}" for key, item in value.items()), ""]
            elif found:
                inner += self._inner(field, found, value, (*path, name), explained)
            elif explained or value is not None:
                lines += _comment(field.description or "") if explained else []
                off = "" if value is not None else _OFF
                shown = value if value is not None else _default(field)
                lines += [f"{off}{name} = {_text(shown)}", *([""] if explained else [])]
        return [*lines, *([] if explained else [""]), *inner]

    def _inner(
        self,
        field: FieldInfo,
        found: list[type[BaseModel]],
        value: Any,
        path: tuple[str, ...],
        explained: bool,
    ) -> list[str]:
        """The tables of a key: one, several by name, or several in a row."""
        kind = get_origin(_bare(field))
        lines = _comment(field.description or "") if explained else []
        off = "" if value is not None else _OFF
        if kind is list:
            if value is None:
                return []
            for item in value:
                lines += [f"[[{'.'.join(path)}]]", *self._once(found, item, path)]
            return lines
        if kind is dict:
            for name, item in (value or {}).items():
                own = (*path, name)
                lines += [f"[{'.'.join(own)}]", *self._once(found, item, own)]
            return lines if value else []
        if value is None and not explained:
            return []
        return [*lines, f"{off}[{'.'.join(path)}]", *self._once(found, value, path)]

    def _once(self, found: list[type[BaseModel]], item: Any, path: tuple[str, ...]) -> list[str]:
        """A table that is explained if none of its kind has been."""
        model = _chosen(found, item)
        explained = model not in self._explained
        self._explained.add(model)
        return self.table(model, item, path, explained)


def _bare(field: FieldInfo) -> Any:
    """The annotation of a field without None."""
    return next(a for a in members([field.annotation]) if a is not type(None))


def _parts(field: FieldInfo) -> list[Any]:
    """What a field's value, or the values in its list or dictionary, may be."""
    bare = _bare(field)
    if get_origin(bare) in (dict, list):
        return members([get_args(bare)[-1]])
    return members([field.annotation])


def _chosen(found: list[type[BaseModel]], item: Any) -> type[BaseModel]:
    """Which of the members of a union a table is."""
    given = {item.get("shape"), item.get("kind", "tilt")} if item is not None else set()
    return next((model for model in found if set(tags(model)) & given), found[0])


def _default(field: FieldInfo) -> Any:
    """The default, or an example where there is none."""
    if field.default or field.default in (0.0, False, ""):
        return field.default
    return _example(field.annotation)


def _example(annotation: Any) -> Any:
    """A value of a kind."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, UnionType):
        return _example(arguments[0])
    if origin is Annotated:
        extras = [e for e in arguments[1:] if isinstance(e, FieldInfo) and e.examples]
        return extras[0].examples[0] if extras and extras[0].examples else _example(arguments[0])
    if origin is Literal:
        return arguments[0]
    if origin is dict:
        return {_JOINT: _example(arguments[1])}
    if origin is list:
        return [_example(arguments[0])]
    return 1.0 if annotation is float else _JOINT


def _comment(text: str) -> list[str]:
    words = " ".join(text.split())
    return textwrap.wrap(words, _WIDTH, initial_indent="# ", subsequent_indent="# ")


def _text(value: Any) -> str:
    """A value in TOML."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{name} = {_text(item)}' for name, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)
