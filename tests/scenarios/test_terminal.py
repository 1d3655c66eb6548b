"""Pages on a terminal: the same content as in Markdown, and nothing in it is more than text."""

import io
import sys

import pytest

from fulcrum.scenarios.commands.terminal import printable, refuse, show
from fulcrum.synthesis.render import (
    Bullets,
    Heading,
    Lines,
    Mark,
    Marked,
    Page,
    page,
    table,
    to_markdown,
)
from tests.helpers.short_run import short_run

NASTY = ("[bold red]FAIL[/]", "[link=x]y", "a[/]b", "\\[x]", ":smile:", "https://x.y", "1.234")


def printed(shown):
    output, sys.stdout = sys.stdout, io.StringIO()
    try:
        show(shown)
        return sys.stdout.getvalue()
    finally:
        sys.stdout = output


@pytest.mark.parametrize("name", NASTY)
def test_what_looks_like_markup_is_shown_as_it_is_everywhere(name):
    everywhere = page(
        Heading((name, Marked(name))), name, Bullets((name,)), table((name,), [(name,)])
    )
    assert printed(everywhere).count(name) == 6


@pytest.mark.parametrize("code", ["\x1b[31m", "\x07", "\x9b31m", "\r", "\n", "\x00", "\u202e"])
def test_what_would_control_a_terminal_is_shown_as_an_escape(code):
    shown = printed(page(f"a{code}b", table(("c",), [(f"d{code}e",)])))
    assert f"a{code}b" not in shown and f"d{code}e" not in shown
    assert shown.count(printable(code)) == 2
    assert printable(code).startswith("\\")


def test_letters_of_any_script_are_shown():
    assert "μ · 箱 ∞" in printed(page("μ · 箱 ∞"))


def test_long_lines_are_not_wrapped_where_there_is_no_terminal():
    line = 60 * "word "
    assert line.strip() in printed(page(line))


def test_units_stand_under_their_titles():
    lines = printed(page(table(("slip [mm]", "name"), [("1", "left")]))).split("\n")
    title = next(i for i, line in enumerate(lines) if "slip" in line)
    assert "[mm]" in lines[title + 1]
    assert "[mm]" not in lines[title]


def test_what_is_empty_is_left_out():
    assert page("", Bullets(()), Lines(()), table(("a",), [])) == Page(())
    assert printed(page("")) == ""


def test_a_report_says_on_a_terminal_and_in_markdown_the_same():
    shown = short_run().page()
    plain = printed(shown).replace(" ", "")
    for block in shown.blocks:
        for row in getattr(block, "rows", ()):
            assert "".join(row).replace(" ", "") in plain
            assert f"| {' | '.join(row)} |" in to_markdown(shown)
    assert f"{short_run().report.scenario}: PASS" in printed(shown)
    assert "Outcome: completed." in printed(shown)
    assert "Outcome: completed." in to_markdown(shown)


def test_a_mark_is_bold_in_markdown_and_absent_in_a_title():
    assert to_markdown(page((Marked("a", Mark.BAD), " b"))) == "**a** b"
    assert to_markdown(page(Heading(("a: ", Marked("b"))))) == "# a: b"


def test_a_refusal_says_that_nothing_has_moved(capsys):
    refuse("it is too heavy.")
    assert capsys.readouterr().out == "REFUSED, nothing has moved: it is too heavy.\n"
