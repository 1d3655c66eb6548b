"""Markdown for notebooks and recordings: tables, numbers and escaped text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

# Characters with a meaning in Markdown or in a notebook's formulas; an underscore inside a word has
# none.
_SPECIAL = re.compile(r"[\\`*\[\]|~$#]|(?<![^\W_])_|_(?![^\W_])")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def escaped(text: object) -> str:
    """Return text on one line, escaped so that Markdown shows each character, also in a table."""
    line = " ".join(str(text).split())
    line = _SPECIAL.sub(r"\\\g<0>", line)
    return re.sub("[&<>]", lambda found: _ENTITIES[found.group()], line)


def number(value: float, digits: int = 4) -> str:
    """Return a number with a count of significant digits; "" for NaN, "∞" for infinity."""
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return "∞" if value > 0.0 else "-∞"
    return f"{value:.{digits}g}"


def numbers(values: Iterable[float], digits: int = 4) -> str:
    """Return several numbers, separated by commas; see :func:`number`."""
    return ", ".join(number(value, digits) for value in values)


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table; none without rows.

    Args:
        head: Titles of the columns with their units, as Markdown.
        rows: Cells as plain text.
    """
    body = [f"| {' | '.join(escaped(cell) for cell in row)} |" for row in rows]
    if not body:
        return []
    return [f"| {' | '.join(head)} |", "|---" * len(head) + "|", *body]


def page(*parts: str | Sequence[str]) -> str:
    """Return paragraphs and tables, separated by empty lines; empty parts are left out."""
    blocks = [part if isinstance(part, str) else "\n".join(part) for part in parts]
    return "\n\n".join(block for block in blocks if block)
