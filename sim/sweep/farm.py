"""Episodes on many processes: a Dask cluster runs them, and each is kept as it finishes."""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import dask
import pyarrow as pa
from distributed import Client, KilledWorker, LocalCluster, as_completed
from distributed.comm.core import CommClosedError

from fulcrum.sim.sweep.design import Episode, Sweep
from fulcrum.sim.sweep.episode import check_holdable, run_episode
from fulcrum.sim.sweep.store import Store
from fulcrum.sim.sweep.summary import Score, scores
from fulcrum.synthesis import FulcrumError, InvalidInputError
from fulcrum.synthesis.checks import whole
from fulcrum.synthesis.render import Lines, Marked, Page, page, table, to_markdown

# How many causes of failures are named.
_NAMED = 6
# How long a scheduler may take to answer, and its first worker to come [s].
_PATIENCE_S = 10
_SETTINGS = {
    # What workers have to say the driver says, or writes into rows.
    "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED": "critical",
    # Nobody reads Dask's profile, which it takes a hundred times a second in every process.
    "distributed.worker.profile.enabled": False,
}

# Called with episodes finished, episodes in total and failures so far.
Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class Workers:
    """Who runs the episodes.

    Attributes:
        count: Of processes on this machine; one for each of its processors if left out.
        scheduler: Address of a running Dask cluster instead, whose workers have fulcrum installed.
    """

    count: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.count is not None:
            whole("--workers", self.count, least=1)
        if self.count is not None and self.scheduler is not None:
            valid = "none beside --scheduler, whose cluster has its own"
            raise InvalidInputError("--workers", self.count, valid)


class LostEpisodesError(FulcrumError):
    """Some episodes took every worker down that tried them; the others are finished."""

    def __init__(self, names: list[str]) -> None:
        self.names = names
        super().__init__(
            f"{len(names)} episodes are missing, because each killed several workers "
            f"(the first is {names[0]}); the same command tries them again."
        )


@dataclass(frozen=True, eq=False)
class SweepResult:
    """What a sweep gave.

    Attributes:
        rows: All episodes, one row each.
        scores: What they come to, by controller.
    """

    rows: pa.Table
    scores: tuple[Score, ...]

    def page(self) -> Page:
        """Return each controller's success rate, and what its failures began with, as a page."""
        rows = [
            (
                score.controller,
                f"{score.successes} of {score.episodes}",
                f"{100.0 * score.rate:.1f} ({100.0 * score.low:.1f} to {100.0 * score.high:.1f})",
                f"{score.grip_n:.1f}",
                _named(score),
            )
            for score in self.scores
        ]
        head = ("controller", "episodes", "success (95 %) [%]", "grip [N]", "failures began with")
        replays = [(s.controller, s.causes[0]) for s in self.scores if s.causes]
        return page(
            Marked("Sweep"),
            table(head, rows),
            Lines(tuple(f"{name}, {first.cause}: {first.replay}" for name, first in replays)),
        )

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


def _named(score: Score) -> str:
    """The most frequent causes of a controller's failures."""
    named = ", ".join(f"{c.cause} ({c.episodes})" for c in score.causes[:_NAMED])
    more = len(score.causes) - _NAMED
    return (named or "none") + (f" and {more} more" if more > 0 else "")


# One process for each of this machine's processors.
LOCAL = Workers()


def run_sweep(
    sweep: Sweep, out: Path, workers: Workers = LOCAL, progress: Progress | None = None
) -> SweepResult:
    """Runs the episodes that are missing in a folder.

    Dask gives the episodes of a worker that dies to another one. What has been written survives
    whatever happens to this process: another call with the same folder goes on from there.

    Args:
        sweep: Who meets which worlds.
        out: New or empty folder, or one of the same sweep.
        workers: Who runs the episodes.
        progress: Called after each.

    Raises:
        PathError: The arms cannot follow the path; nothing has been run.
        UnholdableError: A controller finds no forces somewhere on the path; nothing has been run.
        InvalidInputError: No cluster answers at the address, or the folder holds something else.
        LostEpisodesError: Some episodes killed all workers that tried them.
        KeyboardInterrupt: Somebody pressed Ctrl-C.
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
    progress: Progress | None,
) -> None:
    check_holdable(sweep)
    done, failures = _finished(store)
    total = done + len(missing)
    lost = []
    report = progress or (lambda done, total, failures: None)
    report(done, total, failures)
    with cluster(workers) as client:
        store.begin()
        packed = pickle.dumps(sweep)  # small, and sent along: what is scattered dies with workers
        mark = uuid.uuid4().hex  # a shared cluster knows tasks of others
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
            store.write(episode, row)  # before it counts as finished
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


@contextlib.contextmanager
def cluster(workers: Workers) -> Iterator[Client]:
    """A client of the cluster; one of its own processes ends with it.

    Raises:
        InvalidInputError: No cluster answers at the address.
    """
    with contextlib.ExitStack() as stack:
        if workers.scheduler is None:
            logging.getLogger("distributed").setLevel(logging.CRITICAL)
            stack.enter_context(dask.config.set(_SETTINGS))
            address = stack.enter_context(
                LocalCluster(
                    n_workers=workers.count or os.cpu_count() or 1,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # only for its own use; there is no dashboard
                    silence_logs=logging.CRITICAL,
                    preload="fulcrum.sim.sweep.quiet",
                )
            )
        else:
            address = workers.scheduler
        valid = "the address of a running Dask scheduler with workers, like tcp://host:8786"
        try:
            client = stack.enter_context(Client(address, timeout=_PATIENCE_S))
            client.wait_for_workers(1, timeout=_PATIENCE_S)
        except (OSError, ValueError, CommClosedError) as error:
            raise InvalidInputError(
                "--scheduler", f"{workers.scheduler} ({error})", valid
            ) from None
        yield client
