"""The reference of scenario files as Markdown, from their JSON Schema: a section per TOML table."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from fulcrum.synthesis.markdown import table

Schema = dict[str, Any]
_NAME = "NAME"  # in the header of tables that have names of one's own


class _Section(NamedTuple):
    """A table of the file: its header, and the models that it may be."""

    header: str
    models: tuple[str, ...]


def reference(schema: Schema) -> str:
    """The sections of all tables, each kind of file after the other."""
    models = schema["$defs"]
    parts = []
    for root in _refs(schema["anyOf"]):
        parts += [f"## {_words(root)}", ""]
        for section in _sections(models, _Section("", (root,))):
            if section.header:
                parts += [f"### `{section.header}`", ""]
            parts += _section(models, section)
    return "\n".join(parts)


def _section(models: Schema, section: _Section) -> list[str]:
    """Descriptions and keys; of several models first the keys that all of them have."""
    shared = _shared([models[name] for name in section.models])
    if len(section.models) == 1:
        (model,) = (models[name] for name in section.models)
        return [_sentence(model), "", *_keys(models, model, shared), ""]
    lines = [*_keys(models, models[section.models[0]], shared), ""]
    for name in section.models:
        own = [key for key in models[name]["properties"] if key not in shared]
        lines += [f"**{_sentence(models[name])}**", "", *_keys(models, models[name], own), ""]
    return lines


def _shared(models: list[Schema]) -> list[str]:
    """Keys that mean the same in all models."""
    first, *others = (model["properties"] for model in models)
    return [key for key in first if all(other.get(key) == first[key] for other in others)]


def _sections(models: Schema, section: _Section) -> Iterator[_Section]:
    """The section and those of the tables in it, as they come in the file."""
    yield section
    seen: list[_Section] = []
    for name in section.models:
        for key, value in models[name]["properties"].items():
            found = [f for f in _tables(value) if models[f[0]].get("type") == "object"]
            if found:
                inner = _Section(
                    _header(section.header, key, found[0][1]), tuple(m for m, _ in found)
                )
                if inner not in seen:
                    seen.append(inner)
                    yield from _sections(models, inner)


def _header(outer: str, key: str, form: str) -> str:
    """That of a table under a key of another one."""
    path = f"{outer.strip('[]')}.{key}" if outer else key
    return {"table": f"[{path}]", "named": f"[{path}.{_NAME}]", "list": f"[[{path}]]"}[form]


def _tables(value: Schema) -> list[tuple[str, str]]:
    """The models that a key's value may be, each with its form: table, named or list."""
    found = [(name, "table") for name in _refs([value, *_options(value)])]
    for option in (value, *_options(value)):
        if "items" in option:
            found += [(name, "list") for name in _refs([option["items"]])]
        for inner in (*option.get("patternProperties", {}).values(), _extra(option)):
            found += [(name, "named") for name in _refs([inner])]
    return found


def _options(value: Schema) -> list[Schema]:
    return [*value.get("anyOf", []), *value.get("oneOf", [])]


def _extra(value: Schema) -> Schema:
    extra = value.get("additionalProperties")
    return extra if isinstance(extra, dict) else {}


def _refs(values: list[Schema]) -> list[str]:
    return [value["$ref"].rpartition("/")[2] for value in values if "$ref" in value]


def _keys(models: Schema, model: Schema, keys: list[str]) -> list[str]:
    required, rows = model.get("required", []), []
    for key in keys:
        value = model["properties"][key]
        left_out = "must be there" if key in required else _default(value)
        rows.append((f"`{key}`", _kind(models, value), left_out, _sentence(value)))
    lines = table(("key", "value", "if left out", "what it is"), rows)
    return [line.replace("\\`", "`") for line in lines]  # descriptions hold code


def _default(value: Schema) -> str:
    """What holds where a key is left out; nothing where that is a table or no value."""
    default = value.get("default")
    if default is None or isinstance(default, dict) or default == []:
        return ""
    if isinstance(default, bool):
        return str(default).lower()
    return ", ".join(map(str, default)) if isinstance(default, list) else f"{default}"


def _kind(models: Schema, value: Schema) -> str:
    """What may stand there, in words."""
    if _options(value):
        kinds = (_kind(models, option) for option in _options(value))
        return " or ".join(dict.fromkeys(kind for kind in kinds if kind))
    for name in _refs([value]):
        return _kind(models, models[name])
    if "const" in value:
        return f'"{value["const"]}"'
    if "enum" in value:
        return " or ".join(f'"{word}"' for word in value["enum"])
    match value.get("type"):
        case "array":
            low, high = value.get("minItems"), value.get("maxItems")
            inner = _kind(models, value.get("items", {}))
            if low is not None and low == high:
                return f"list of {low}: {inner}"
            return f"list of: {inner}"
        case "object" if "properties" in value:
            return "table"
        case "object":
            return "table by name"
        case "number" | "integer" as kind:
            return f"{kind}{_range(value)}"
        case "string":
            return "text"
        case "boolean":
            return "true or false"
        case _:
            return ""


def _range(value: Schema) -> str:
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    found = [f" {sign} {value[key]:g}" for key, sign in signs.items() if key in value]
    return ",".join(found)


def _sentence(value: Schema) -> str:
    return " ".join(value.get("description", "").split())


def _words(model: str) -> str:
    """A model's name as words: HollowCylinderTable is a hollow cylinder."""
    spaced = "".join(f" {c.lower()}" if c.isupper() else c for c in model)
    return spaced.removesuffix(" table").strip()
