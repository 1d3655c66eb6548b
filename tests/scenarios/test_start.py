"""Where commands write, and what they do without a home, an argument or a folder to write to."""

import os
import pwd
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path

import pytest

from fulcrum.assets.cache import cached, folder
from fulcrum.scenarios import cli
from fulcrum.scenarios.cli import main
from fulcrum.scenarios.commands import common
from fulcrum.sim.run.files import claim_folder

ROOT = Path(__file__).parents[2]
SHORT = "run box-tilt --controller no-feedforward --duration 3"


class Stopped(datetime):
    """A clock that stands, so that two runs begin in the same second."""

    @classmethod
    def now(cls, tz=None):
        return cls(2026, 1, 2, 3, 4, 5)


# --- folders ---


def test_two_runs_in_the_same_second_have_two_folders(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(common, "datetime", Stopped)
    for _ in range(2):
        assert main(SHORT.split()) == 1  # nothing is lifted
    names = sorted(path.name for path in Path("logs").iterdir())
    name = "box-tilt-no-feedforward-20260102-030405"
    assert names == [name, f"{name}-2"]
    for run in Path("logs").iterdir():
        assert {path.name for path in run.iterdir()} == {"run.rrd", "config.json", "report.json"}
    assert f"{name}-2/run.rrd" in capsys.readouterr().out


def test_a_folder_is_claimed_once_by_all_who_ask_at_the_same_time(tmp_path):
    with ThreadPoolExecutor(16) as pool:
        claimed = list(pool.map(lambda _: claim_folder(tmp_path / "logs" / "run"), range(64)))
    assert len(set(claimed)) == 64
    assert all(path.is_dir() for path in claimed)


def test_a_refused_run_leaves_no_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "box-lift"]) == 1  # no forces exist
    assert "nothing has moved" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_something_in_it_is_not_removed(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "row").touch()
    (tmp_path / "empty").mkdir()
    for name in ("full", "empty"):
        with common.removed_if_empty(tmp_path / name):
            pass
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


@pytest.fixture
def read_only(tmp_path, monkeypatch):
    """A working folder in which no folder can be made, whoever the user is."""

    def refused(path, *_, **__):
        raise OSError(30, "Read-only file system", str(path))

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Path, "mkdir", refused)
    return tmp_path


def test_check_answers_in_a_read_only_folder(read_only, capsys):
    assert main(["check", "box-tilt"]) == 0
    output, errors = capsys.readouterr()
    assert "FEASIBLE" in output
    assert len(errors.splitlines()) == 1
    assert "Read-only file system" in errors
    assert "--out" in errors
    assert list(read_only.iterdir()) == []


@pytest.mark.parametrize("line", [SHORT, "sweep box-tilt --episodes 1", "reproduce"])
def test_what_has_to_write_says_where_it_cannot(line, read_only, capsys):
    assert main(line.split()) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert len(errors.splitlines()) == 1
    assert "--out" in errors
    assert "Read-only file system" in errors


def test_a_folder_without_permission_is_refused_before_the_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert main(["check", "box-tilt", "--out", str(tmp_path / "new")]) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert "may be written to" in errors


# --- start ---


def test_without_arguments_the_help_is_printed(capsys):
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 0
    assert "usage: fulcrum" in capsys.readouterr().out


def test_a_bug_ends_with_code_70_and_its_traceback(monkeypatch, capsys):
    def broken(_):
        raise ZeroDivisionError("as no command should")

    monkeypatch.setattr(cli, "_parse", broken)
    assert main(["list"]) == 70
    errors = capsys.readouterr().err
    assert "ZeroDivisionError" in errors
    assert "bug" in errors.splitlines()[-1]


# Asks Python for the home of a user whom the machine does not know.
UNKNOWN = """
import pwd, sys
def unknown(key):
    raise KeyError(key)
pwd.getpwuid = pwd.getpwnam = unknown
from pathlib import Path
try:
    Path.home()
except RuntimeError:
    from fulcrum.scenarios.cli import main
    sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(("line", "code"), [("check box-tilt", 0), (SHORT, 1)])
def test_an_unknown_user_without_a_home_is_served(line, code, tmp_path):
    gone = ("HOME", "XDG_CACHE_HOME", "USER", "LOGNAME")
    environment = {name: value for name, value in os.environ.items() if name not in gone}
    environment["PYTHONPATH"] = str(ROOT / "src")
    command = [sys.executable, "-c", UNKNOWN, *line.split()]
    done = subprocess.run(
        command, check=False, cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout


def test_without_a_home_nothing_is_kept(monkeypatch):
    def unknown(uid):
        raise KeyError(uid)

    monkeypatch.delenv("HOME")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert folder() is None
    made = []
    for _ in range(2):
        assert cached("key", lambda: made.append(1) or []) == []
    assert made == [1, 1]
