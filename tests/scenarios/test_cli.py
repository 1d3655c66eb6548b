"""The command line: exit codes, one clear line for bad input, and no files left by it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fulcrum.scenarios import scenarios
from fulcrum.scenarios.cli import main
from fulcrum.sim.scenario.control import Control, controllers
from fulcrum.synthesis import Objective

ROOT = Path(__file__).parents[2]
# Packages that take long to import; what `fulcrum --help` needs of the house has only arrays.
HEAVY = (
    "mujoco",
    "distributed",
    "pyarrow",
    "dm_control",
    "mink",
    "pinocchio",
    "rerun",
    "cvxpy",
    "trimesh",
    "fulcrum.sim",
    "rich",
)

BAD = {
    "unknown command": "tilt box-tilt",
    "unknown flag": "run box-tilt --speed 3",
    "flag without value": "run box-tilt --duration",
    "no scenario": "run",
    "unknown scenario": "run sofa-tilt",
    "two scenarios": "run box-tilt box-tilt",
    "duration that is no number": "run box-tilt --duration long",
    "negative duration": "run box-tilt --duration -1",
    "no duration": "run box-tilt --duration 0",
    "NaN duration": "run box-tilt --duration nan",
    "infinite duration": "run box-tilt --duration inf",
    "duration beyond memory": "run box-tilt --duration 1e308",
    "duration too short for the arms": "run box-tilt --duration 0.05",
    "negative seed": "run box-tilt --seed -1",
    "seed that is no integer": "run box-tilt --seed 1.5",
    "unknown controller": "run box-tilt --controller pid",
    "unknown objective": "run box-tilt --objective min-effort",
    "out is a file": "run box-tilt --out file",
    "out is not empty": "run box-tilt --out full",
    "out is below a file": "run box-tilt --out file/new/out",
    "screenshot of nothing": "screenshot nothing --at 1",
    "screenshot of an empty folder": "screenshot empty --at 1",
    "screenshot of no recording": "screenshot file --at 1",
    "screenshot of a false recording": "screenshot false.rrd --at 1",
    "screenshot without moment": "screenshot false.rrd",
    "screenshot at no number": "screenshot false.rrd --at noon",
    "screenshot into a missing folder": "screenshot false.rrd --at 1 --out missing/x.png",
    "view of nothing": "view nothing",
    "view of a false recording": "view false.rrd",
}
# What the line must say besides: the culprit, what was given or what is valid.
NAMED = {
    "unknown command": "tilt",
    "unknown flag": "--speed",
    "flag without value": "--duration",
    "no scenario": "SCENARIO",
    "unknown scenario": "box-tilt",
    "duration that is no number": "long",
    "negative duration": "-1.0",
    "NaN duration": "nan",
    "duration beyond memory": "<= 600",
    "duration too short for the arms": "speed limit",
    "negative seed": "--seed",
    "seed that is no integer": "1.5",
    "unknown controller": "margin, paper, no-feedforward",
    "unknown objective": "max-normal-force",
    "out is a file": "new or empty folder",
    "out is not empty": "new or empty folder",
    "out is below a file": "new or empty folder",
    "screenshot of nothing": "nothing",
    "screenshot without moment": "--at",
    "screenshot into a missing folder": "missing",
    "view of nothing": "nothing",
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A working folder with a file, a false recording, a full and an empty folder."""
    (tmp_path / "file").write_text("no recording")
    (tmp_path / "false.rrd").write_text("no recording either")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thing").touch()
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder):
    return {path: path.is_file() and path.read_bytes() for path in folder.rglob("*")}


def fulcrum(*arguments, cwd=ROOT):
    command = [sys.executable, "-m", "fulcrum.scenarios.cli", *arguments]
    environment = {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}", "PATH": "", "HOME": str(cwd)}
    return subprocess.run(
        command, check=False, cwd=cwd, env=environment, capture_output=True, text=True
    )


# --- bad input ---


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gives_exit_code_2_one_line_and_no_files(case, place, capsys):
    before = contents(place)
    assert main(BAD[case].split()) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors.startswith("fulcrum: ")
    assert len(errors.splitlines()) == 1
    assert errors.endswith("\n")
    assert NAMED.get(case, "") in errors
    assert contents(place) == before


@pytest.mark.parametrize("case", ["unknown command", "duration too short for the arms"])
def test_the_process_itself_ends_with_code_2_and_one_line(case, place):
    before = contents(place)
    done = fulcrum(*BAD[case].split(), cwd=place)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("fulcrum: ")
    assert len(done.stderr.splitlines()) == 1
    assert contents(place) == before


def test_a_file_that_a_command_leaves_would_be_noticed(place):
    before = contents(place)
    (place / "full" / "new").touch()
    assert contents(place) != before


def test_an_unknown_name_is_answered_with_all_valid_ones(capsys):
    main(["run", "sofa-tilt"])
    answer = capsys.readouterr().err
    assert all(name in answer for name in scenarios())


WORDS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8)
BAD_VALUES = {
    "--duration": st.sampled_from(["nan", "-inf", "0", "-1e-9", "1e9", "8s", "", "1,5", "0x1p3"]),
    "--seed": st.sampled_from(["-1", "1.0", "1e3", "", "one", "-99999999999999999999"]),
    "--controller": WORDS.filter(lambda w: w not in [*controllers(Control()), "None"]),
    "--objective": WORDS.filter(lambda w: w not in [*Objective, "None"]),
    "--out": st.sampled_from(["file", "full", "file/x", "full/thing/y", "."]),
    "--at": st.sampled_from(["noon", ""]),
    "--live": st.sampled_from(["perhaps"]),
}
UNKNOWN_FLAGS = st.from_regex(r"--x[a-z-]{0,6}", fullmatch=True)


@st.composite
def bad_arguments(draw):
    """Arguments of which at least one is bad, so that no command gets to work."""
    command = draw(st.sampled_from(["run", "run", "run", "screenshot", "view", "list", ""]))
    command = command or draw(WORDS.filter(lambda w: w not in ("run", "view", "list")))
    flags = draw(st.lists(st.sampled_from(sorted(BAD_VALUES)), max_size=3, unique=True))
    options = [[flag, draw(BAD_VALUES[flag])] for flag in flags]
    if "--seed" not in flags:
        options += [["--seed", "7"]] * draw(st.integers(0, 1))
    if command != "run" or not flags:
        options.append([draw(UNKNOWN_FLAGS)])
    if command == "run":
        options.append(["box-tilt"])
    order = draw(st.permutations(options))
    return [command, *(word for option in order for word in option)]


@settings(
    max_examples=100,
    derandomize=True,
    deadline=None,
    # The working folder is only read.
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(arguments=bad_arguments())
def test_whatever_is_wrong_with_the_arguments_there_is_one_line_and_code_2(
    place, capsys, arguments
):
    before = contents(place)
    capsys.readouterr()
    try:
        code = main(arguments)
    except SystemExit as asked_for_help:
        assert asked_for_help.code == 0
        assert {"-h", "--help"} & set(arguments)
        return
    output, errors = capsys.readouterr()
    assert (code, output) == (2, ""), arguments
    assert errors.startswith("fulcrum: "), arguments
    assert len(errors.splitlines()) == 1, arguments
    assert contents(place) == before


# --- help and list ---


@pytest.mark.parametrize("arguments", ["--help", "run --help", "screenshot -h", "view -h"])
def test_help_is_answered_with_code_0(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments.split())
    assert stop.value.code == 0
    output, errors = capsys.readouterr()
    assert "usage: fulcrum" in output
    assert errors == ""


def test_list_names_every_scenario_controller_and_objective(capsys):
    assert main(["list"]) == 0
    words = set(capsys.readouterr().out.replace(",", " ").split())
    assert {*scenarios(), *controllers(Control()), *Objective} <= words
    assert "sofa-tilt" not in words


def imported_by(*arguments):
    """Which heavy packages a command has imported by its end, in a process of its own."""
    code = (
        "import sys\n"
        "from fulcrum.scenarios.cli import main\n"
        "try:\n    main(sys.argv[1:])\n"
        "except SystemExit:\n    pass\n"
        f"print(*[name for name in {HEAVY} if name in sys.modules], sep='\\n', file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, check=True, cwd=ROOT, capture_output=True, text=True)
    return set(done.stderr.split())


def test_help_imports_nothing_heavy():
    assert imported_by("--help") == set()


def test_a_heavy_import_is_noticed():
    assert {"fulcrum.sim", "mujoco"} <= imported_by("run", "box-tilt", "--seed", "-1")


# --- a run that works ---


def test_a_run_that_fails_its_checks_gives_code_1_and_says_why(place, capsys):
    # Without feed-forward nothing is lifted, however short the tilt.
    arguments = "run box-tilt --controller no-feedforward --duration 3 --out results"
    assert main(arguments.split()) == 1
    output = capsys.readouterr().out
    assert "FAIL" in output
    assert "let go at" in output
    results = {path.name for path in (place / "results").iterdir()}
    assert results == {"run.rrd", "config.json", "report.json"}


def test_a_run_that_passes_gives_code_0_and_its_verdict(place, capsys):
    assert main(["run", "box-tilt", "--out", "empty"]) == 0
    output, errors = capsys.readouterr()
    assert errors == ""
    assert "PASS" in output
    assert str(Path("empty") / "run.rrd") in output
    assert all(contact in output for contact in scenarios()["box-tilt"].contact_names)
