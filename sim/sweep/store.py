"""The folder of a sweep: its configuration, one file per finished episode, and the final table."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fulcrum.sim.run import check_new_folder, write_json
from fulcrum.sim.sweep.design import Episode, Sweep
from fulcrum.sim.sweep.episode import Row
from fulcrum.synthesis import InvalidInputError

CONFIG, PARTS, EPISODES, SUMMARY, MAP = (
    "config.json",
    "parts",
    "episodes.parquet",
    "sweep.json",
    "map.png",
)
# Options for a file of one row, which is half as long without aids for searching.
_LEAN = {"use_dictionary": False, "write_statistics": False}


class Store:
    """The store of finished episodes: rows written by :meth:`write` survive the process.

    Each episode has a file name of its own, so that it cannot be stored twice.
    """

    def __init__(self, sweep: Sweep, out: Path) -> None:
        """Check a folder, in which a sweep is begun or resumed.

        Args:
            sweep: Sweep to store.
            out: Folder, which is new, empty or of the same sweep.

        Raises:
            InvalidInputError: The folder holds another sweep, or something else.
        """
        self.folder, self._parts = out, out / PARTS
        self._episodes = sweep.all_episodes()
        self._config = json.loads(json.dumps(sweep.config()))
        if (out / CONFIG).is_file():
            self._check_same()
        else:
            check_new_folder("--out", out)

    def _check_same(self) -> None:
        try:
            there = json.loads((self.folder / CONFIG).read_text())
        except ValueError:
            there = None
        if not isinstance(there, dict):
            there = {}
        names = dict.fromkeys([*self._config, *there])
        other = [name for name in names if there.get(name) != self._config.get(name)]
        if other:
            valid = "a new folder, or one of the same sweep"
            given = f"{self.folder} with a sweep of other {', '.join(other)}"
            raise InvalidInputError("--out", given, valid)

    def begin(self) -> None:
        """Make the folder if necessary, and write the configuration of the sweep into it."""
        self._parts.mkdir(parents=True, exist_ok=True)
        partial = self._parts / f"{CONFIG}.partial"
        write_json(partial, self._config)
        partial.replace(self.folder / CONFIG)

    def missing(self) -> list[Episode]:
        """Return the episodes that are not finished."""
        if (self.folder / EPISODES).is_file():
            return []
        done = {path.stem for path in self._parts.glob("*.parquet")}
        return [episode for episode in self._episodes if episode.name not in done]

    def write(self, episode: Episode, row: Row) -> None:
        """Store a finished episode; the whole file is on the disk when this returns."""
        path = self._parts / f"{episode.name}.parquet"
        _write(pa.Table.from_pylist([row]), path, _LEAN)

    def read(self) -> pa.Table:
        """Return all finished episodes in their order."""
        whole = self.folder / EPISODES
        if whole.is_file():
            return pq.read_table(whole)
        finished = (self._parts / f"{episode.name}.parquet" for episode in self._episodes)
        tables = [pq.ParquetFile(path).read() for path in finished if path.is_file()]
        return pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})

    def merge(self) -> pa.Table:
        """Return all episodes, none missing, and write them to one file instead of many."""
        table = self.read()
        if not (self.folder / EPISODES).is_file():
            _write(table, self.folder / EPISODES, {"compression": "zstd"})
        shutil.rmtree(self._parts, ignore_errors=True)
        return table


def _write(table: pa.Table, path: Path, options: dict[str, Any]) -> None:
    """Write a file atomically: it exists as a whole or not at all."""
    partial = path.with_suffix(".partial")
    with partial.open("wb") as file:
        pq.write_table(table, file, **options)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
