"""Pages: the presentation of a result as headings, paragraphs, lists and tables.

Every result makes one page. Notebooks and recordings show it as Markdown, commands on a terminal.
Texts are plain: each medium escapes them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from fulcrum.synthesis import markdown


class Mark(Enum):
    """The way in which a piece of text is emphasised."""

    STRONG = auto()
    GOOD = auto()
    BAD = auto()
    DOUBTFUL = auto()


@dataclass(frozen=True)
class Marked:
    """A piece of emphasised text."""

    text: str
    mark: Mark = Mark.STRONG


# A line: one piece of text, or several.
Line = str | Marked | tuple["str | Marked", ...]


@dataclass(frozen=True)
class Heading:
    """The title of a page."""

    line: Line


@dataclass(frozen=True)
class Lines:
    """A paragraph, with line breaks if the medium can show them."""

    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Bullets:
    """A list."""

    items: tuple[Line, ...]


@dataclass(frozen=True)
class Table:
    """A table; its titles end in their unit, such as ``slip [mm]``."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


Block = Heading | Lines | Bullets | Table


@dataclass(frozen=True)
class Page:
    """The blocks that present a result, from top to bottom."""

    blocks: tuple[Block, ...]

    def __add__(self, other: Page) -> Page:
        return Page((*self.blocks, *other.blocks))


def page(*blocks: Block | Line) -> Page:
    """Return a page of blocks without the empty ones; a line alone is a paragraph."""
    whole = (b if isinstance(b, Block) else Lines((b,)) for b in blocks)
    return Page(tuple(block for block in whole if not _empty(block)))


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
    """Return a table; cells are shown as plain text."""
    return Table(tuple(head), tuple(tuple(str(cell) for cell in row) for row in rows))


def pieces(line: Line) -> tuple[str | Marked, ...]:
    """Return the pieces of text that a line is made of."""
    return line if isinstance(line, tuple) else (line,)


def to_markdown(shown: Page) -> str:
    """Return a page as Markdown."""
    return markdown.page(*(_markdown(block) for block in shown.blocks))


def _markdown(block: Block) -> str | list[str]:
    match block:
        case Heading():
            return f"# {_inline(block.line, marks=False)}"
        case Lines():
            return [_inline(line) for line in block.lines]
        case Bullets():
            return [f"- {_inline(item)}" for item in block.items]
        case Table():
            return markdown.table(block.head, block.rows)


def _inline(line: Line, marks: bool = True) -> str:
    parts = []
    for piece in pieces(line):
        shown = _spaced(piece if isinstance(piece, str) else piece.text)
        parts.append(f"**{shown}**" if marks and isinstance(piece, Marked) else shown)
    return "".join(parts)


def _spaced(text: str) -> str:
    """Return the text escaped, with one space where it begins or ends with space."""
    start, end = text[: len(text) - len(text.lstrip())], text[len(text.rstrip()) :]
    return f"{' ' * bool(start)}{markdown.escaped(text)}{' ' * bool(end)}"


def _empty(block: Block) -> bool:
    match block:
        case Lines():
            return not any(block.lines)
        case Bullets():
            return not block.items
        case Table():
            return not block.rows
    return False
