"""Prints pages on a terminal."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from fulcrum.synthesis.render import (
    Block,
    Bullets,
    Heading,
    Line,
    Lines,
    Mark,
    Marked,
    Page,
    Table,
    page,
    pieces,
)

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text

_STYLES = {
    Mark.STRONG: "bold",
    Mark.GOOD: "bold green",
    Mark.BAD: "bold red",
    Mark.DOUBTFUL: "bold yellow",
}


def show(shown: Page) -> None:
    """Print a page: lines are never wrapped, and nothing in them is markup or controls the screen.

    Tables are as wide as they need to be where the output is no terminal.
    """
    from rich.console import Console

    console = Console(highlight=False)
    for before, block in zip((None, *shown.blocks), shown.blocks, strict=False):
        if before is not None and (isinstance(before, Table) or isinstance(block, Table)):
            console.print()
        width = None if console.is_terminal else _WIDE
        for part in _rendered(block):
            wraps = isinstance(block, Table)
            console.print(part, soft_wrap=not wraps, width=width if wraps else None)
    sys.stdout.flush()


def refuse(why: str) -> None:
    """Print that a run is refused, and why."""
    show(page((Marked("REFUSED", Mark.BAD), f", nothing has moved: {why}")))


# Columns of a table where no terminal limits them.
_WIDE = 200


def _rendered(block: Block) -> list[RenderableType]:
    match block:
        case Heading():
            return [_text(block.line)]
        case Lines():
            return [_text(line) for line in block.lines]
        case Bullets():
            return [_text(("  - ", *pieces(item))) for item in block.items]
        case Table():
            return [_table(block)]


def _table(block: Table) -> RenderableType:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as Rich
    from rich.text import Text

    drawn = Rich(box=SIMPLE_HEAD, pad_edge=False)
    for title in block.head:
        name, bracket, unit = title.rpartition(" [")
        head = Text(name if bracket else title, "bold")
        if bracket:
            head.append(f"\n[{unit}", "dim")
        drawn.add_column(head)
    for row in block.rows:
        drawn.add_row(*map(_text, row))
    return drawn


def _text(line: Line) -> Text:
    from rich.text import Text

    found = Text()
    for piece in pieces(line):
        if isinstance(piece, Marked):
            found.append(printable(piece.text), _STYLES[piece.mark])
        else:
            found.append(printable(piece))
    return found


def printable(text: str) -> str:
    """Return the text with control characters, which a terminal would obey, as escapes."""
    return "".join(
        c if c.isprintable() or c == " " else c.encode("unicode_escape").decode() for c in text
    )
