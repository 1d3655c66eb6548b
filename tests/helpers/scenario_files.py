"""A folder with a good scenario file in it, and commands on such files."""

import shlex

import pytest

from fulcrum.scenarios.cli import main
from fulcrum.scenarios.reading.file import read
from tests.helpers.broken_files import GOOD


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a good file, and with what broken ones name."""
    place = tmp_path / "mine"
    place.mkdir()
    (place / "good.toml").write_text(GOOD)
    (place / "none.stl").write_text("solid nothing\nendsolid nothing\n")
    (place / "none.urdf").write_text("no XML")
    (tmp_path / "outside.urdf").write_text("<robot/>")
    (place / "link.urdf").symlink_to(tmp_path / "outside.urdf")
    monkeypatch.chdir(place)
    return place


def ended(line, capsys):
    """Exit code, output and errors of a command."""
    code = main(shlex.split(line))
    output, errors = capsys.readouterr()
    return code, output, errors


def said(folder, *changes):
    """The scenario of the good file with some of its text replaced."""
    text = GOOD
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "said.toml").write_text(text)
    return read(folder / "said.toml")
