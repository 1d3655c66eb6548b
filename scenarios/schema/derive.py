"""Makes tables of the scenario file from settings classes of the code: keys, ranges and docs.

``physics: FromTable[Physics]`` in a table says that the file has a table there with the keys of
:class:`Physics`, and that reading it makes an instance of it.
"""

from __future__ import annotations

import ast
import dataclasses
import enum
import inspect
import itertools
import sys
from functools import cache, reduce
from operator import or_
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from annotated_types import Len
from pydantic import Field, GetCoreSchemaHandler, create_model
from pydantic_core import CoreSchema, core_schema

from fulcrum.scenarios.schema.kinds import FileTable
from fulcrum.synthesis.settings import Inline, Key, Settings, Unlimited, hints, said


class _Derived:
    """Reads an instance of a settings class from its table."""

    def __get_pydantic_core_schema__(
        self, settings: type[Settings], handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        table = handler.generate_schema(table_of(settings))
        return core_schema.no_info_after_validator_function(lambda t: instance(settings, t), table)


T = TypeVar("T", bound=Settings)
AnyTable = TypeVar("AnyTable", bound=FileTable)
FromTable = Annotated[T, _Derived()]
_TABLES: dict[type, type[FileTable]] = {}


def table_of(settings: type) -> type[FileTable]:
    """Return the table of a settings class, as a model."""
    if settings not in _TABLES:
        _TABLES[settings] = derived(settings.__name__, FileTable, settings)
    return _TABLES[settings]


def derived(name: str, base: type[AnyTable], settings: type, **keys: Any) -> type[AnyTable]:
    """Return a table with the keys of another one, of its own, and of a settings class."""
    keys |= keys_of(settings)
    return create_model(
        name,
        __base__=base,
        __doc__=inspect.cleandoc(settings.__doc__ or "").partition("\n\n")[0],
        __cls_kwargs__={"use_attribute_docstrings": False},  # they are there; a search takes 0.1 s
        **keys,
    )


def keys_of(settings: type) -> dict[str, Any]:
    """Return kinds and descriptions of the keys of a settings class."""
    keys: dict[str, Any] = {}
    docs = _docs(settings)
    for field in dataclasses.fields(settings):
        key, inline = _key(settings, field.name)
        if inline is not None:
            keys |= keys_of(inline)
        elif key is not None:
            kind = _in_file(hints(settings)[field.name])
            keys[key] = (kind, Field(**_default(field), description=docs[field.name]))
    return keys


def same(settings: type, name: str) -> Any:
    """Return default and description of a key that stands for a field of a dataclass."""
    field = next(field for field in dataclasses.fields(settings) if field.name == name)
    return Field(**_default(field), description=_docs(settings)[name])


def _default(field: dataclasses.Field[Any]) -> dict[str, Any]:
    """Return the default of a field, as pydantic takes it; nothing for a field without one."""
    if isinstance(field.default, Settings):
        return {"default_factory": lambda: field.default}
    if field.default is dataclasses.MISSING:
        return {}
    return {"default": list(field.default) if isinstance(field.default, tuple) else field.default}


def _key(settings: type, field: str) -> tuple[str | None, type[Settings] | None]:
    """Return the key of a field, if it has one, or the settings class with keys in its place."""
    annotation = hints(settings)[field]
    key = said(annotation, Key)
    inline = get_args(annotation)[0] if said(annotation, Inline) else None
    return (key.name if key else field), inline


def instance(settings: type[T], table: FileTable, **instead: Any) -> T:
    """Return the instance of a settings class that a table means, with other values if given."""
    values: dict[str, Any] = {}
    for field in hints(settings):
        key, inline = _key(settings, field)
        if inline is not None:
            values[field] = instance(inline, table)
        elif key is not None:
            value = getattr(table, key)
            values[field] = tuple(value) if isinstance(value, list) else value
    return settings(**values | instead)


def _in_file(annotation: Any) -> Any:
    """Return what TOML has for a kind of value: lists, texts and tables."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        unlimited = (Field(allow_inf_nan=True),) if Unlimited in arguments else ()
        return Annotated[(_in_file(arguments[0]), *arguments[1:], *unlimited)]
    if origin in (Union, UnionType):
        return reduce(or_, map(_in_file, arguments))
    if origin is tuple:
        item: Any = arguments[0]
        return Annotated[list[item], Len(len(arguments), len(arguments))]
    if isinstance(annotation, type) and issubclass(annotation, Settings):
        return Annotated[annotation, _Derived()]
    if isinstance(annotation, type) and issubclass(annotation, enum.Enum):
        return Annotated[annotation, Field(strict=False)]
    return annotation


def _docs(settings: type) -> dict[str, str]:
    """Return the texts below the fields of a class and of its base classes."""
    found: dict[str, str] = {}
    for base in filter(dataclasses.is_dataclass, reversed(settings.__mro__)):
        body = _classes(base.__module__)[base.__name__].body
        for field, doc in itertools.pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(doc, ast.Expr):
                assert isinstance(field.target, ast.Name) and isinstance(doc.value, ast.Constant)
                found[field.target.id] = inspect.cleandoc(str(doc.value.value))
    return found


@cache
def _classes(module: str) -> dict[str, ast.ClassDef]:
    """Return the classes of a module as they stand in its source."""
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
