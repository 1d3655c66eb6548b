"""Reads recordings back: shared by the tests of the recording."""

import subprocess
import sys
import warnings
from collections import defaultdict

import numpy as np
from rerun.chunk import RrdReader

# Times are stored in whole nanoseconds, cut off.
NANOSECOND = 1.001e-9


class Content:
    """What a recording holds, by entity and component, in the order of time."""

    def __init__(self, path):
        with warnings.catch_warnings():
            # A recording that was cut off has no footer; that is the point of some tests.
            warnings.simplefilter("ignore")
            chunks = RrdReader(path).stream().to_chunks()
        self._batches = defaultdict(list)
        for chunk in chunks:
            self._batches[str(chunk.entity_path).strip("/")].append(chunk.to_record_batch())
        self.entities = set(self._batches)

    def series(self, entity, component):
        """Times [s], (k,), and values, (k, numbers per row), sorted by time."""
        times, values = [], []
        for batch in self._batches[entity]:
            if "time" in batch.schema.names and component in batch.schema.names:
                column = batch[component]
                while hasattr(column, "flatten") and "list" in str(column.type):
                    column = column.flatten()
                times.append(batch["time"].cast("int64").to_numpy() * 1e-9)
                values.append(column.to_numpy().reshape(batch.num_rows, -1))
        times, values = np.concatenate(times), np.concatenate(values)
        order = np.argsort(times, kind="stable")
        return times[order], values[order]

    def poses(self, body, component):
        """The series of a component of one body's poses, which share an entity with the others'."""
        entity, frame = "world/poses", [f"tf#/world/{body}"]
        batches = [b for b in self._batches[entity] if "time" in b.schema.names]
        frames = [f for b in batches for f in b["Transform3D:child_frame"].to_pylist()]
        times = np.concatenate([b["time"].cast("int64").to_numpy() for b in batches])
        # Rows of one time stand in one order in all columns, and sorting by time is stable.
        order = np.argsort(times, kind="stable")
        mine = np.array([f == frame for f in frames])[order]
        times, values = self.series(entity, component)
        return times[mine], values[mine]

    def static(self, entity, component):
        """The last value of something that has no time."""
        batches = [b for b in self._batches[entity] if component in b.schema.names]
        batches = [b for b in batches if "time" not in b.schema.names]
        # Row ids rise with the time of writing.
        last = max(batches, key=lambda b: b["rerun.controls.RowId"][-1].as_py())
        return last[component].to_pylist()[-1]

    def text(self, entity):
        (text,) = self.static(entity, "TextDocument:text")
        return text

    def states(self, entity):
        """Times [s] and names of the changes of a state, in the order of time."""
        changes = []
        for batch in self._batches[entity]:
            if "time" in batch.schema.names and "StateChange:state" in batch.schema.names:
                times = batch["time"].cast("int64").to_numpy() * 1e-9
                names = [names[0] for names in batch["StateChange:state"].to_pylist()]
                changes += zip(times.tolist(), names, strict=True)
        return sorted(changes)

    def end(self, entity="plots/tilt", component="Scalars:scalars"):
        return self.series(entity, component)[0][-1]


def verified(path):
    """Whether `rerun rrd verify` finds the file whole."""
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0
