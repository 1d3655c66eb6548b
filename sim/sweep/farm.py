"""Episodes on many processes: a Dask cluster runs them, and each is stored when it finishes."""

from __future__ import annotations

import pickle
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
from distributed import KilledWorker, as_completed

from fulcrum.sim.run import LOCAL, Workers, cluster
from fulcrum.sim.sweep.design import Episode, Sweep
from fulcrum.sim.sweep.episode import check_holdable, run_episode
from fulcrum.sim.sweep.store import Store
from fulcrum.sim.sweep.summary import Score, scores
from fulcrum.synthesis import FulcrumError, InvalidInputError
from fulcrum.synthesis.render import Lines, Page, page, table, to_markdown

# Largest number of causes of failures that are shown.
_NAMED = 6

# Called with episodes finished, episodes in total and failures so far.
SweepProgress = Callable[[int, int, int], None]


class LostEpisodesError(FulcrumError):
    """Some episodes ended every worker that tried them; the others are finished."""

    def __init__(self, names: list[str]) -> None:
        self.names = names
        super().__init__(
            f"{len(names)} episodes are missing, because each killed several workers "
            f"(the first is {names[0]}); the same command tries them again."
        )


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The results of a sweep.

    Attributes:
        rows: Table of all episodes, one row each.
        scores: Success rate and causes of failure of each controller.
    """

    rows: pa.Table
    scores: tuple[Score, ...]

    def page(self) -> Page:
        """Return each controller's success rate, first causes of failure, and replays as a page."""
        rows = [
            (
                score.controller,
                f"{score.successes} of {score.episodes}",
                f"{100.0 * score.rate:.1f} ({100.0 * score.low:.1f} to {100.0 * score.high:.1f})",
                f"{score.grip_n:.1f}",
                f"{100.0 * score.friction:.0f}",
                f"{score.force_error_n:.2f}",
                _named(score),
            )
            for score in self.scores
        ]
        head = ("controller", "episodes", "success (95 %) [%]", "grip [N]")
        more = ("friction used [%]", "force error [N]", "first causes of failure")
        replays = [(s.controller, s.causes[0]) for s in self.scores if s.causes]
        return page(
            "Success rates with their 95 % intervals, and medians over the episodes:",
            table((*head, *more), rows),
            Lines(
                tuple(f"Replay of {name}, {first.cause}: {first.replay}" for name, first in replays)
            ),
        )

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


def _named(score: Score) -> str:
    """Return the most frequent causes of a controller's failures as text."""
    named = ", ".join(f"{c.cause} ({c.episodes})" for c in score.causes[:_NAMED])
    more = len(score.causes) - _NAMED
    return (named or "none") + (f" and {more} more" if more > 0 else "")


def run_sweep(
    sweep: Sweep, out: Path, workers: Workers = LOCAL, progress: SweepProgress | None = None
) -> SweepResult:
    """Run the episodes that are missing in a folder.

    If a worker dies, Dask gives its episodes to another one. Finished episodes stay in the folder
    if this process ends: another call with the same folder resumes the sweep.

    Args:
        sweep: Controllers and worlds.
        out: Folder, which is new, empty or of the same sweep.
        workers: Processes or cluster that run the episodes.
        progress: Called after each episode.

    Raises:
        PathError: The arms cannot follow the path; nothing has been run.
        UnholdableError: A controller finds no forces somewhere on the path; nothing has been run.
        InvalidInputError: No cluster answers at the address, or the folder holds something else.
        LostEpisodesError: Some episodes ended all workers that tried them.
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    store = Store(sweep, out)
    missing = store.missing()
    if missing:
        _run(sweep, store, missing, workers, progress)
    rows = store.merge()
    return SweepResult(rows, scores(rows, tuple(hand.name for hand in sweep.scenario.hands)))


def _run(
    sweep: Sweep,
    store: Store,
    missing: list[Episode],
    workers: Workers,
    progress: SweepProgress | None,
) -> None:
    check_holdable(sweep)
    done, failures = _finished(store)
    total = done + len(missing)
    lost = []
    report = progress or (lambda done, total, failures: None)
    report(done, total, failures)
    with cluster(workers) as client:
        store.begin()
        packed = pickle.dumps(sweep)  # sent with each task: scattered data are lost with a worker
        mark = uuid.uuid4().hex  # tells our tasks from others on a shared cluster
        tasks = {
            client.submit(run_episode, packed, e, key=f"{e.name}-{mark}", pure=False): e
            for e in missing
        }
        for task in as_completed(tasks):
            episode = tasks.pop(task)
            try:
                row = task.result()
            except KilledWorker:
                lost.append(episode.name)
                continue
            except ImportError as error:
                valid = "a cluster whose workers have this fulcrum installed"
                raise InvalidInputError("--scheduler", f"{error}", valid) from None
            store.write(episode, row)  # before it is counted as finished
            done, failures = done + 1, failures + (not row["success"])
            report(done, total, failures)
    if lost:
        raise LostEpisodesError(lost)


def _finished(store: Store) -> tuple[int, int]:
    table = store.read()
    if not len(table):
        return 0, 0
    success = table["success"].to_pylist()
    return len(success), success.count(False)
