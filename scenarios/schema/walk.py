"""Walks through the models of a scenario file: which of them describes the table at a key."""

from __future__ import annotations

from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from fulcrum.scenarios.schema.derive import table_of
from fulcrum.synthesis.settings import Settings


def table_at(model: type[BaseModel], loc: tuple[str | int, ...]) -> type[BaseModel]:
    """The model of the table in which a location ends."""
    reached: list[Any] = [model]
    for part in loc[:-1]:
        inner = [step for annotation in reached for step in steps(annotation, part)]
        reached = inner or reached  # a tag names no more than which of the union's members it is
    found = tables(members(reached))
    tagged = [t for t in found if set(tags(t)) & set(loc)]
    return (tagged or found)[0]


def members(annotations: list[Any]) -> list[Any]:
    """What annotations are made of, with unions and decorations taken apart."""
    found = []
    for annotation in annotations:
        origin, arguments = get_origin(annotation), get_args(annotation)
        if origin is Annotated:
            found += members([arguments[0]])
        elif origin in (Union, UnionType):
            found += members(list(arguments))
        else:
            found.append(annotation)
    return found


def tables(annotations: list[Any]) -> list[type[BaseModel]]:
    """The models among annotations, and those of settings classes."""
    types = [a for a in annotations if isinstance(a, type)]
    found = [table_of(a) if issubclass(a, Settings) else a for a in types]
    return [a for a in found if issubclass(a, BaseModel)]


def steps(annotation: Any, part: str | int) -> list[Any]:
    """What a key or an index of a value of that kind leads to."""
    found = []
    for member in members([annotation]):
        for table in tables([member]):
            if part in table.model_fields:
                found.append(table.model_fields[str(part)].annotation)
        if get_origin(member) is dict and isinstance(part, str):
            found.append(get_args(member)[1])
        elif get_origin(member) is list and isinstance(part, int):
            found.append(get_args(member)[0])
    return found


def tags(table: type[BaseModel]) -> tuple[str, ...]:
    """What the table's shape or kind may be, if that says which table it is."""
    for name in ("shape", "kind"):
        field = table.model_fields.get(name)
        if field is not None and get_origin(field.annotation) is Literal:
            return get_args(field.annotation)
    return ()
