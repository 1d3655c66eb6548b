"""The page on the house names every package, and files and names that exist."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HOUSE = ROOT / "docs" / "house.md"


def answers(text):
    """Rows of a table that answer with a file and a name in it."""
    return re.findall(r"^\| [^|]+ \| `([\w/]+\.py)` \| `([\w.]+)` \|$", text, re.MULTILINE)


def defined(source, name):
    """Whether a module defines a class or function of that name, or a class's method."""
    body = ast.parse(source).body
    for part in name.split("."):
        definitions = (ast.ClassDef, ast.FunctionDef)
        found = [n for n in body if isinstance(n, definitions) and n.name == part]
        if not found:
            return False
        body = found[0].body
    return True


def wrong_answers(text):
    return [
        (file, name)
        for file, name in answers(text)
        if not (ROOT / file).is_file() or not defined((ROOT / file).read_text(), name)
    ]


def test_the_house_says_where_to_find_what():
    text = HOUSE.read_text()
    table = text[text.index("## Where do I find") :].partition("\n\nA setting")[0]
    rows = [line for line in table.splitlines() if line.startswith("| ")]
    assert len(answers(table)) == len(rows) - 1 > 20  # all but the head
    assert wrong_answers(table) == []


def test_the_house_names_all_packages():
    rows = re.findall(r"^\| `([a-z/]+)` \|", HOUSE.read_text(), re.MULTILINE)
    packages = {"assets", "synthesis"} | {
        path.parent.relative_to(ROOT).as_posix()
        for top in ("synthesis", "sim", "scenarios")
        for path in (ROOT / top).glob("*/__init__.py")
    }
    assert sorted(rows) == sorted(packages)


@pytest.mark.parametrize(
    "row",
    [
        "| slip | `sim/evaluation/watch.py` | `Monitor.update` |",
        "| slip | `sim/evaluation/monitor.py` | `Watch` |",
        "| slip | `sim/evaluation/monitor.py` | `Monitor.slip` |",
    ],
)
def test_a_wrong_answer_is_caught(row):
    assert len(wrong_answers(row)) == 1
    assert wrong_answers("| slip | `sim/evaluation/monitor.py` | `Monitor.update` |") == []
