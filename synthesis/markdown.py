"""Markdown that notebooks and recordings show: tables, and names that cannot break them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

# What Markdown or the formulas of a notebook would read as more than itself; an underscore inside a
# word is none of it.
_SPECIAL = re.compile(r"[\\`*\[\]|~$#]|(?<![^\W_])_|_(?![^\W_])")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def escaped(text: object) -> str:
    """The text on one line, so that Markdown shows each of its characters, also in a table."""
    line = " ".join(str(text).split())
    line = _SPECIAL.sub(r"\\\g<0>", line)
    return re.sub("[&<>]", lambda found: _ENTITIES[found.group()], line)


def number(value: float, digits: int = 4) -> str:
    """A number with so many digits that count; empty for what is not there (NaN), as ∞ if so."""
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return "∞" if value > 0.0 else "-∞"
    return f"{value:.{digits}g}"


def numbers(values: Iterable[float], digits: int = 4) -> str:
    """Several such numbers with commas between."""
    return ", ".join(number(value, digits) for value in values)


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """The lines of a table; empty without rows.

    Args:
        head: Titles of the columns with their units; Markdown.
        rows: What the cells show, as plain text.
    """
    body = [f"| {' | '.join(escaped(cell) for cell in row)} |" for row in rows]
    if not body:
        return []
    return [f"| {' | '.join(head)} |", "|---" * len(head) + "|", *body]


def page(*parts: str | Sequence[str]) -> str:
    """Paragraphs and tables with an empty line between; parts without text are left out."""
    blocks = [part if isinstance(part, str) else "\n".join(part) for part in parts]
    return "\n\n".join(block for block in blocks if block)
