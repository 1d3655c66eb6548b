"""The cache gives what was made, and a cache that is broken costs time alone."""

import numpy as np
import pytest

from fulcrum.assets.cache import cached, folder


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


class Maker:
    """Makes two arrays, and counts how often."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return [np.arange(3.0), np.eye(2)]


def same(arrays):
    return [a.tolist() for a in arrays] == [[0.0, 1.0, 2.0], [[1.0, 0.0], [0.0, 1.0]]]


def test_what_was_made_once_is_read_the_second_time():
    make = Maker()
    assert same(cached("key", make))
    assert same(cached("key", make))
    assert make.calls == 1
    assert same(cached("another key", make))
    assert make.calls == 2


@pytest.mark.parametrize("damage", [b"", b"no archive", b"PK\x03\x04 half an archive"])
def test_a_damaged_file_is_made_again(damage):
    make = Maker()
    cached("key", make)
    (folder() / "key.npz").write_bytes(damage)
    assert same(cached("key", make))
    assert same(cached("key", make))
    assert make.calls == 2


def test_a_cache_that_cannot_be_written_costs_only_time(home):
    (home / "fulcrum").write_text("a file where the folder should be")
    make = Maker()
    assert same(cached("key", make))
    assert same(cached("key", make))
    assert make.calls == 2


def test_nothing_but_whole_files_is_left_behind():
    cached("key", Maker())
    assert [path.name for path in folder().iterdir()] == ["key.npz"]
