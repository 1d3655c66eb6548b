"""A sweep's folder: what it is of, one file per finished episode, in the end all as one table."""

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
# What helps to search many rows makes a file of one row twice as long.
_LEAN = {"use_dictionary": False, "write_statistics": False}


class Store:
    """Keeps what has been finished: a row that :meth:`write` took outlives the process.

    The name of an episode's file is its own, so that none can be there twice.
    """

    def __init__(self, sweep: Sweep, out: Path) -> None:
        """Looks at a new or empty folder, or one of the same sweep, to go on with it.

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
        """Makes the folder, if need be, and writes down what it is of."""
        self._parts.mkdir(parents=True, exist_ok=True)
        partial = self._parts / f"{CONFIG}.partial"
        write_json(partial, self._config)
        partial.replace(self.folder / CONFIG)

    def missing(self) -> list[Episode]:
        """The episodes that are not finished."""
        if (self.folder / EPISODES).is_file():
            return []
        done = {path.stem for path in self._parts.glob("*.parquet")}
        return [episode for episode in self._episodes if episode.name not in done]

    def write(self, episode: Episode, row: Row) -> None:
        """Keeps a finished episode: on the disk, and whole, when this returns."""
        path = self._parts / f"{episode.name}.parquet"
        _write(pa.Table.from_pylist([row]), path, _LEAN)

    def read(self) -> pa.Table:
        """All finished episodes in their order."""
        whole = self.folder / EPISODES
        if whole.is_file():
            return pq.read_table(whole)
        finished = (self._parts / f"{episode.name}.parquet" for episode in self._episodes)
        tables = [pq.ParquetFile(path).read() for path in finished if path.is_file()]
        return pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})

    def merge(self) -> pa.Table:
        """All episodes as one file, when none is missing; the files of each are removed."""
        table = self.read()
        if not (self.folder / EPISODES).is_file():
            _write(table, self.folder / EPISODES, {"compression": "zstd"})
        shutil.rmtree(self._parts, ignore_errors=True)
        return table


def _write(table: pa.Table, path: Path, options: dict[str, Any]) -> None:
    """Writes a file that is there whole or not at all, whatever happens meanwhile."""
    partial = path.with_suffix(".partial")
    with partial.open("wb") as file:
        pq.write_table(table, file, **options)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
