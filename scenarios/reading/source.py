"""Errors in a scenario file, as one sentence with file, line, key and the valid values."""

from __future__ import annotations

import contextlib
import difflib
import itertools
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fulcrum.scenarios.schema.kinds import CORNER, NAME, PREFIX
from fulcrum.scenarios.schema.walk import table_at
from fulcrum.synthesis import InvalidInputError

KeyPath = tuple[str | int, ...]

# Similarity of two words of which one may be a misspelling of the other [-].
_ALIKE = 0.6
# Number of valid words that are named if there are many.
_NAMED = 8
# Kinds of values in TOML, by pydantic's names of errors.
_KINDS = {
    "float_type": "a number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "a string in quotes",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": (">", "gt"),
    "greater_than_equal": (">=", "ge"),
    "less_than": ("<", "lt"),
    "less_than_equal": ("<=", "le"),
}
# What the patterns of :mod:`scenarios.schema.kinds` say, in words.
_FORMS = {
    NAME: "a name of letters, digits, _ and - that begins with a letter",
    CORNER: 'a corner of the box such as "-x +y -z"',
    PREFIX: "letters, digits and _ that begin with a letter",
}


class FileError(InvalidInputError):
    """A scenario file is not valid.

    Attributes:
        file: Scenario file.
        line: Line of the error, counted from 1; None if it is on no line.
        key: Path of the key in the file.
    """

    def __init__(self, file: Path, line: int | None, key: str, given: object, valid: str) -> None:
        self.file, self.line, self.key = file, line, key
        place = str(file) if line is None else f"{file}:{line}"
        super().__init__(f"{place}: {key}" if key else place, given, valid)


class Source:
    """The text of a scenario file, which finds the line of a key.

    Attributes:
        file: File of the text.
        data: Content of the text.

    Raises:
        FileError: The text is not TOML.
    """

    def __init__(self, file: Path, text: str) -> None:
        self.file, self._lines = file, [f"{line}\n" for line in text.split("\n")]
        try:
            self.data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            reason, _, place = str(error).rstrip(")").rpartition(" (at ")
            line = place.removeprefix("line ").partition(",")[0]
            number = int(line) if line.isdigit() else max(1, len(self._lines))
            text = self._lines[number - 1].strip() if number <= len(self._lines) else ""
            reason = (reason or str(error)).rstrip(".")
            raise FileError(file, number, "", f"'{text}'", f"TOML: {_lower(reason)}") from None
        except RecursionError:
            raise FileError(file, None, "", "brackets too deep", "TOML") from None

    def error(self, key: KeyPath, given: object, valid: str) -> FileError:
        """Return the error of a key, on its line or that of the nearest table around it."""
        return FileError(self.file, self.line(key), dotted(key), given, valid)

    @contextlib.contextmanager
    def at(self, key: KeyPath) -> Iterator[None]:
        """Turn refusals of dataclasses that are made inside into errors of the file."""
        try:
            yield
        except FileError:
            raise
        except InvalidInputError as error:
            raise self.refused(key, error) from None

    def refused(self, key: KeyPath, error: InvalidInputError) -> FileError:
        """Return the refusal of a dataclass that the table at a key made, as one of the file."""
        name = error.field.rpartition(".")[2]
        table: Any = self.data
        for part in key:
            table = table[part] if _has(table, part) else {}
        if isinstance(table, dict):
            key = (*key, *[given for given in table if given.startswith(name)][:1])
        return self.error(key, error.given, error.valid)

    def line(self, key: KeyPath) -> int | None:
        """Return the line of the statement with a key, or of the table that lacks the key."""
        known = key
        while known and not _holds(self.data, known):
            known = known[:-1]
        if not known:
            return None
        low, high = 0, len(self._lines)  # does not hold it, holds it
        while high - low > 1:
            middle = (low + high) // 2
            end = self._statement_end(middle)
            if end <= low:
                low = middle
            elif _holds(self._until(end), known):
                high = end if end < high else middle
            else:
                low = middle
        start = self._statement_end(high - 1) if high > 1 else 0
        blank = itertools.takewhile(_says_nothing, self._lines[start:high])
        return start + len(list(blank)) + 1

    def _statement_end(self, lines: int) -> int:
        """Return the largest number of lines, at most this, that are TOML by themselves."""
        while lines > 0 and self._until(lines) is None:
            lines -= 1
        return lines

    def _until(self, lines: int) -> Any:
        try:
            return tomllib.loads("".join(self._lines[:lines]))
        except tomllib.TOMLDecodeError:
            return None


def _says_nothing(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith("#")


def _holds(data: Any, key: KeyPath) -> bool:
    for part in key:
        if not _has(data, part):
            return False
        data = data[part]
    return True


def _has(data: Any, part: str | int) -> bool:
    if isinstance(data, list):
        return isinstance(part, int) and part < len(data)
    return isinstance(data, dict) and part in data


def dotted(key: KeyPath) -> str:
    """Return a key as people write it: ``robots[0].posture_deg.left_s0``."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def nearest(word: str, known: list[str]) -> str:
    """Return the valid words as text, those first of which a word may be a misspelling."""
    alike = difflib.get_close_matches(word, known, n=_NAMED, cutoff=_ALIKE)
    others = [other for other in known if other not in alike]
    shown = [*alike, *others][: max(_NAMED, len(alike))] if len(known) > 2 * _NAMED else []
    if shown:
        more = len(known) - len(shown)
        rest = f"{', '.join(shown[1:])} and {more} more"
    else:
        shown = [*alike, *others]
        rest = ", ".join(shown[1:])
    if alike and rest:
        return f"{shown[0]}, perhaps; or {rest}"
    return f"one of {shown[0]}, {rest}" if rest else shown[0]


def explained(source: Source, kind: str, error: ValidationError) -> FileError:
    """Return the first of pydantic's errors as a sentence, which counts the others."""
    found = []
    for details in error.errors(include_url=False):
        key = _key(source.data, details["loc"])
        # A key that does not exist is why another is missing.
        found.append((details["type"] != "extra_forbidden", source.line(key) or 0, key, details))
    found.sort(key=lambda item: item[:2])
    _, _, key, details = found[0]
    if details["type"] == "value_error":
        return source.refused(key, details["ctx"]["error"])
    given, valid = _sentence(kind, details, key)
    if len(found) > 1:
        valid += f" (and {len(found) - 1} more errors)"
    return source.error(key, given, valid)


def _key(data: Any, loc: tuple[str | int, ...]) -> KeyPath:
    """Return the key of pydantic's location, which also names the members of unions."""
    key: list[str | int] = []
    for i, part in enumerate(loc):
        last = i == len(loc) - 1
        there = _has(data, part)
        if not there and not last:
            continue
        if part == "[key]":
            continue
        key.append(part)
        data = data[part] if there else None
    return tuple(key)


def _sentence(file: str, details: Any, key: KeyPath) -> tuple[object, str]:
    """Return what was given, and what is valid."""
    kind, given, context = details["type"], details["input"], details.get("ctx", {})
    if kind == "extra_forbidden":
        return "a key that does not exist", nearest(
            str(key[-1]), list(table_at(file, details["loc"])["properties"])
        )
    if kind == "missing":
        return "nothing", _described(file, details["loc"])
    if kind == "string_type" and {"edge", "corner"} & set(details["loc"]):
        points = "point_m and axis" if "edge" in details["loc"] else "point_m"
        return _shown(given), f"{_FORMS[CORNER]}; points go into {points}, as those of meshes must"
    if kind in _KINDS:
        return _shown(given), _KINDS[kind]
    if kind in _BOUNDS:
        sign, bound = _BOUNDS[kind]
        return _shown(given), f"a number {sign} {context[bound]:g}"
    if kind in ("too_short", "too_long"):
        count = context.get("min_length", context.get("max_length"))
        if isinstance(given, dict):
            return f"{len(given)} tables", f"{count} at least"
        return f"{context['actual_length']} values", f"{count} values"
    if kind == "literal_error":
        known = [word.strip(" '") for word in context["expected"].replace(" or ", ",").split(",")]
        return _shown(given), nearest(str(given), known)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        known = [word.strip(" '") for word in context.get("expected_tags", "").split(",") if word]
        tag = context.get("tag", "nothing")
        name = context["discriminator"].strip("'_()")
        return f"{name} {tag}", nearest(str(tag), known) if known else "a table with a shape"
    if kind == "string_pattern_mismatch":
        return _shown(given), _FORMS[context["pattern"]]
    return _shown(given), details["msg"]


def _shown(given: object) -> str:
    text = f'"{given}"' if isinstance(given, str) else str(given)
    text = text.lower() if isinstance(given, bool) else text
    return text if len(text) <= 60 else f"{text[:57]}.."


def _described(file: str, loc: tuple[str | int, ...]) -> str:
    key = table_at(file, loc)["properties"][loc[-1]]
    text = key.get("description", "a value").rstrip(".").replace("\n", " ")
    return f"a value for this key ({_lower(text)})"


def _lower(text: str) -> str:
    """Return a sentence as part of another."""
    return text[:1].lower() + text[1:]
