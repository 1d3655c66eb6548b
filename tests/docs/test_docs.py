"""Every snippet and command in README and docs does what it says."""

import contextlib
import io
import itertools
import math
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
import tyro
from distributed import LocalCluster
from markdown_it import MarkdownIt

from fulcrum.scenarios import scenarios
from fulcrum.scenarios.cli import AnyCommand, main
from fulcrum.sim.scenario.physics import Tolerances
from fulcrum.sim.sweep.farm import Workers
from tests.helpers.short_run import short_tilt

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
# What commands run in the place of the scene of that name. So short a tilt is mostly the build-up
# of grip, which the measured forces follow less closely.
SHORT = replace(short_tilt(10.0, 1.2), tolerances=Tolerances(force_error=0.2))

# What is made smaller before it runs; the rest of the line runs as it stands.
SMALLER = {
    "--episodes 500": "--episodes 1 --controllers margin --scheduler {scheduler}",
    "--episodes 20": "--episodes 1 --scheduler {scheduler}",
    "=0.7:1.3:7,mass=0.8,1.0,1.2": "=0.7",
    'fulcrum.sweep(box, 20, ("robust", "margin"), preset="lab",': (
        'fulcrum.sweep(SHORT, 1, ("robust", "margin"), preset="lab", '
        'workers=Workers(scheduler="{scheduler}"),'
    ),
    "place mine.toml": "place mine.toml --evaluations 60 --seconds 60",
    "place crate.toml": "place crate.toml --evaluations 60 --seconds 60",
    "[--stretch 1.5]": "--stretch 1.5",  # so short a tilt in least time is all acceleration
    "--tilt-deg 30": "--tilt-deg 8",
    "robust 20\nmargin 20": "robust 1\nmargin 1",
}
# What is only parsed, and why.
PARSED = {
    "fulcrum view": "opens a window",
    "fulcrum screenshot": "needs a Vulkan driver; tests/test_pictures.py draws where there is one",
    "fulcrum reproduce": "takes 10 s; tests/scenarios/test_reproduce.py",
    "fulcrum crosscheck": "needs Drake; tests/sim/run/test_crosscheck.py",
    "fulcrum run box-tilt --engine drake": "needs Drake; tests/sim/plant/test_drake.py",
    "fulcrum run crate.toml": "takes as long as the whole tilt that python.md runs",
}
# What ends with code 1, and why.
FAILS = {
    "fulcrum explain box-lift": "there are no forces",
}

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
# Physics on another machine, at most; a unit of the last digit is rounding.
RELATIVE = 0.02


class Block(NamedTuple):
    """A fenced block: its page, the line at which it begins, its language and its text."""

    page: str
    line: int
    language: str
    text: str


def blocks(page, text):
    """All fenced blocks of a page."""
    tokens = MarkdownIt().parse(text)
    return [
        Block(page, token.map[0] + 1, token.info.strip(), token.content)
        for token in tokens
        if token.type == "fence"
    ]


def commands(block):
    """Lines that start a command, without their comments."""
    if block.language not in ("", "sh"):
        return []
    lines = (re.sub(r"\s+#\s.*", "", line) for line in block.text.splitlines())
    return [line for line in lines if line.startswith(("fulcrum ", "make "))]


def read(path):
    return blocks(path.relative_to(ROOT).as_posix(), path.read_text())


BLOCKS = {path.relative_to(ROOT).as_posix(): read(path) for path in PAGES}
PYTHON = [page for page, found in BLOCKS.items() if any(b.language == "python" for b in found)]
LINES = list(
    dict.fromkeys(line for found in BLOCKS.values() for block in found for line in commands(block))
)
FULCRUM = [line for line in LINES if line.startswith("fulcrum ")]


def smaller(text, scheduler):
    """What runs in the place of a snippet or command."""
    for asked, instead in SMALLER.items():
        text = text.replace(asked, instead.format(scheduler=scheduler))
    return text


def agrees(expected, actual):
    """Whether a printed line is the expected one, but for the last digits of its numbers."""
    if NUMBER.split(expected.rstrip()) != NUMBER.split(actual.rstrip()):
        return False
    return all(
        math.isclose(float(a), float(b), rel_tol=RELATIVE, abs_tol=unit(a))
        for a, b in zip(NUMBER.findall(expected), NUMBER.findall(actual), strict=True)
    )


def unit(number):
    """A unit of the last digit of a number with a decimal point; of a whole number, none."""
    mantissa, _, exponent = number.partition("e")
    decimals = mantissa.partition(".")[2]
    return 10.0 ** (int(exponent or 0) - len(decimals)) if decimals else 0.0


def prints(expected, actual):
    """Whether a snippet prints what stands below it; a line of three dots is any lines."""
    asked, given = expected.splitlines(), actual.splitlines()
    if not asked:
        return not given
    if asked[0] == "...":
        rest = "\n".join(asked[1:])
        return any(prints(rest, "\n".join(given[k:])) for k in range(len(given) + 1))
    later = "\n".join(asked[1:]), "\n".join(given[1:])
    return bool(given) and agrees(asked[0], given[0]) and prints(*later)


def perform(found, scheduler=""):
    """Does what the blocks of a page say, one after the other, in the working folder."""
    names = {"__name__": "__main__", "SHORT": SHORT, "Workers": Workers}
    for block, following in itertools.pairwise([*found, Block("", 0, "", "")]):
        where = f"{block.page}:{block.line}"
        if block.language == "python":
            code = compile("\n" * block.line + smaller(block.text, scheduler), where, "exec")
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                exec(code, names)
            if following.language == "text":
                expected = smaller(following.text, scheduler)
                assert prints(expected, output.getvalue()), f"{where} prints\n{output.getvalue()}"
        for line in commands(block):
            if line.startswith("fulcrum ") and not line.startswith(tuple(PARSED)):
                run(line, scheduler, where)


def run(line, scheduler, where):
    """Runs a command with a short scene; what is in brackets is left out."""
    words = shlex.split(re.sub(r"\[.*?\]", "", smaller(line, scheduler)))
    output = io.StringIO()
    with contextlib.ExitStack() as stack:
        stack.enter_context(pytest.MonkeyPatch.context()).setitem(scenarios(), SHORT.name, SHORT)
        stack.enter_context(contextlib.redirect_stdout(output))
        code = main(words[1:])
    for folder in Path("logs").glob("*-20[0-9][0-9]*-[0-9]*"):
        shutil.rmtree(folder)  # named by the second, in which the next may begin
    said = f"{where}: {line}: code {code}\n{output.getvalue()}"
    if {"--preset", "--world"} & set(words) and words[1] == "run":
        assert code == 0 and f"{SHORT.name}: PASS" in output.getvalue(), said
    else:
        assert code == (1 if line.startswith(tuple(FAILS)) else 0), said


def parse(line):
    """The command of a line; what is in brackets is an option that may be left out."""
    words = shlex.split(re.sub(r"[\[\]]", "", line))
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            return tyro.cli(AnyCommand, prog="fulcrum", args=words[1:])
    except SystemExit:
        raise AssertionError(f"not a command: {line}") from None


def targets():
    return set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


@pytest.fixture(scope="module")
def scheduler():
    """A cluster in this process, for sweeps of one episode."""
    settings = {"processes": False, "dashboard_address": None}
    with LocalCluster(n_workers=1, threads_per_worker=1, **settings) as cluster:
        host = cluster.scheduler
        yield host.address


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_there_are_pages_snippets_and_commands():
    # Guards the tests below against empty lists.
    assert {"README.md", "docs/index.md", "docs/python.md"} <= set(BLOCKS)
    assert len(PYTHON) >= 4
    assert len(FULCRUM) >= 15


@pytest.mark.parametrize("page", [page for page, found in BLOCKS.items() if found])
def test_pages_do_what_they_say(page, place, scheduler):
    perform(BLOCKS[page], scheduler)


@pytest.mark.parametrize("line", LINES)
def test_commands_are_commands(line):
    if line.startswith("make "):
        assert line.split()[1] in targets()
    else:
        parse(line)


def test_nothing_stands_in_the_tables_for_nothing():
    text = "".join(block.text for found in BLOCKS.values() for block in found)
    assert [asked for asked in SMALLER if asked not in text] == []
    for table in (PARSED, FAILS):
        assert [start for start in table if not any(n.startswith(start) for n in FULCRUM)] == []


def test_sections_that_pages_take_from_readme_are_there():
    readme = (ROOT / "README.md").read_text()
    taken = [
        name
        for path in PAGES
        for name in re.findall(r'--8<-- "README\.md:(\w+)"', path.read_text())
    ]
    assert set(taken) == set(re.findall(r"--8<-- \[start:(\w+)\]", readme))
    assert len(taken) > 2
    for name in taken:
        assert readme.count(f"--8<-- [start:{name}]") == 1, name
        assert readme.count(f"--8<-- [end:{name}]") == 1, name


# --- README: short, and what it shows is what a run prints ---

MOST_LINES = 110


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= MOST_LINES


def test_readme_links_to_files_that_are_there():
    found = links((ROOT / "README.md").read_text())
    assert len(found) > 8
    assert [link for link in found if not (ROOT / link).is_file()] == []


def links(text):
    """Where the links and pictures of a page lead."""
    tokens = [child for token in MarkdownIt().parse(text) for child in token.children or ()]
    return [token.attrs.get("href") or token.attrs["src"] for token in tokens if token.attrs]


def test_the_demo_prints_what_readme_shows(tmp_path):
    # In the Makefile it is this command.
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        assert main(["run", "box-tilt", "--out", str(tmp_path)]) == 0
    shown = next(b.text for b in BLOCKS["README.md"] if b.text.startswith("box-tilt: PASS"))
    assert printed_as_shown(shown, output.getvalue())
    assert not printed_as_shown(shown.replace("0.021", "0.027"), output.getvalue())


def printed_as_shown(shown, output):
    """Whether an output has the lines that a page shows, but for time and place."""
    asked, given = (
        [re.sub(r"; [\d.]+ x real.*|Recording: .*", "", line).strip() for line in text.splitlines()]
        for text in (shown, output)
    )
    asked, given = list(filter(None, asked)), list(filter(None, given))
    # Long lines wrap.
    return len(asked) > 8 and agrees(" ".join(asked), " ".join(given))


# --- the house: where to find what ---


# --- negative controls ---


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("```python\nraise ValueError\n```", ValueError),
        ("```python\nfrom fulcrum.sim.run.execute import perform\n```", ImportError),
        ("```python\nprint(1.5)\n```\n\n```text\n1.6\n```", AssertionError),
        ("```python\nprint('pass')\n```\nprints\n```text\nfail\n```", AssertionError),
        ("```python\nx = 1\n```\n\n```text\n1\n```", AssertionError),
        ("```python\nprint('a')\nprint('b')\n```\n\n```text\n...\na\n```", AssertionError),
        ("```python\nx = 1\n```\n\n```python\nprint(y)\n```", NameError),
    ],
)
def test_a_wrong_snippet_is_caught(text, error):
    with pytest.raises(error):
        perform(blocks("page", text))


def test_a_right_snippet_passes():
    perform(blocks("page", "```python\nx = 2\n```\n```python\nprint(x)\n```\n```text\n2\n```"))
    perform(blocks("page", "```python\nprint('a\\nb\\nc')\n```\n```text\na\n...\n```"))


@pytest.mark.parametrize(
    "line", ["fulcrum tilt box", "fulcrum run box-tilt --fast", "fulcrum sweep box-tilt"]
)
def test_a_wrong_command_is_caught(line):
    (found,) = commands(blocks("page", f"```sh\n{line}   # a comment\n```")[0])
    assert found == line
    with pytest.raises(AssertionError, match="not a command"):
        parse(found)


@pytest.mark.parametrize(
    ("expected", "actual", "same"),
    [
        ("27.245 N", "27.250 N", True),
        ("27.245 N", "28.0 N", False),
        ("0.005 deg", "0.006 deg", True),
        ("0.005 deg", "0.007 deg", False),
        ("20 of 20", "19 of 20", False),
        ("[2.0e-05]", "[2.1e-05]", True),
        ("[2.0e-05]", "[2.0e-04]", False),
        ("pass", "fail", False),
    ],
)
def test_numbers_may_differ_by_their_last_digit_and_words_may_not(expected, actual, same):
    assert agrees(expected, actual) is same
