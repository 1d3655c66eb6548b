"""The search for the best placement of robots and hands, by differential evolution.

Robot bases, contact places, rotations of the hands and start posture are variables x in a unit cube
(:mod:`sim.placement.freedom`). The synthesis at a few tilts gives the cost of a placement, which is
minimised (:mod:`sim.placement.value`). Differential evolution begins with a Sobol sample of the
cube. The best candidates are then evaluated over the full joint path and run in closed loop. The
result is the first one that passes both and costs less than the given placement.

Source: Storn and Price, Differential Evolution, Journal of Global Optimization 11, 1997.
"""

from __future__ import annotations

import contextlib
import math
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from fulcrum.sim.evaluation import Report, Verdict
from fulcrum.sim.model import Names
from fulcrum.sim.motion import PathError
from fulcrum.sim.placement.freedom import Freedom, Moves
from fulcrum.sim.placement.value import COARSE, FULL, Goal, Value, assess, settled, touching
from fulcrum.sim.run import Request, Workers, cluster
from fulcrum.sim.run.execute import execute
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.sim.scenario import controller as control_named
from fulcrum.synthesis import FulcrumError
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.checks import positive, whole

# Largest and smallest number of placements in a generation; 1, 2 or 4 processes share it evenly.
_POPULATION, _LEAST = 32, 8
# Spread of the costs in a generation at which the search ends [-].
_ALIKE = 1e-5
# Number of candidates evaluated in full, and their least distance in some variable [-].
_FINALISTS, _APART = 4, 0.01
# Least gain, as a share of the cost [-]; less is noise.
_GAIN = 1e-3
# Share of the time that is reserved for the full evaluation of candidates [-].
_KEPT = 0.35

# Called with evaluations done and in total, and a note.
SearchProgress = Callable[[int, int, str], None]
# Calls a function with a pickled task and each item of a sequence, on all processes.
_Call = Callable[[Callable, bytes, Sequence], list]


@dataclass(frozen=True)
class Effort:
    """The effort of a search.

    The same seed gives the same placement, unless the time ends before the evaluations.

    Attributes:
        evaluations: Largest number of placements that are evaluated; at least 8.
        seconds: Time limit of the whole search [s].
        seed: Seed of the samples.
        workers: Number of processes; 1 uses the present one.
    """

    evaluations: int = 600
    seconds: float = 120.0
    seed: int = 0
    workers: int = 2

    def __post_init__(self) -> None:
        whole("effort.evaluations", self.evaluations, least=_LEAST)
        whole("effort.seed", self.seed, least=0)
        whole("effort.workers", self.workers, least=1)
        positive("effort.seconds", self.seconds)


@dataclass(frozen=True, eq=False)
class Placement:
    """The result of a search.

    Attributes:
        scenario: Scene with the best placement; the given one if nothing better was found.
        goal: Goal of the search.
        before, after: Values of the given and the best placement over the full joint path.
        report: Report of the best one's closed-loop run; None if nothing better was found.
        refused: Reasons why better candidates were refused, the best candidate first.
        history: Evaluations done and least cost so far, after every sample.
        in_time: Whether the search ended before its time limit.
        seconds: Duration of the search [s].
    """

    scenario: Scenario
    goal: Goal
    before: Value
    after: Value
    report: Report | None
    refused: tuple[str, ...]
    history: tuple[tuple[int, float], ...]
    in_time: bool
    seconds: float

    @property
    def improved(self) -> bool:
        """Whether a better placement was found."""
        return self.report is not None


@dataclass(frozen=True)
class _Task:
    """The data that every evaluation needs."""

    scenario: Scenario
    controller: str
    control: Control
    goal: Goal
    freedom: Freedom


def search(
    scenario: Scenario,
    controller: str = "robust",
    goal: Goal = Goal.LARGEST_MARGIN,
    freedom: Freedom | None = None,
    effort: Effort | None = None,
    progress: SearchProgress | None = None,
) -> Placement:
    """Search for the best placement.

    Args:
        scenario: Scene with the present placement, which may be infeasible.
        controller: Name of the controller, which gives the margins and runs the candidates.
        goal: Goal of the search.
        freedom: Ranges in which the placement may move.
        effort: Limits of evaluations and time.
        progress: Called after every sample.

    Raises:
        InvalidInputError: Nothing may move, the freedom does not fit the scene, or there is no such
            controller.
    """
    started = time.monotonic()
    effort = effort or Effort()
    control = control_named(scenario.control, controller)
    packed = pickle.dumps(_Task(scenario, controller, control, goal, freedom or Freedom()))
    moves = _shared(packed).moves
    report = progress or (lambda done, total, note: None)
    with _processes(effort.workers) as call:
        sampler = _Sampler(moves.start, effort, started + (1.0 - _KEPT) * effort.seconds)
        sampler.run(lambda batch: call(_cost, packed, batch), report)
        best, total = sampler.best(), effort.evaluations
        report(sampler.done, total, "the best over the full path")
        before, *looked = call(_look, packed, [None, *best])
        looked = [f for f in looked if f[1].cost < (1.0 - _GAIN) * before[1].cost]
        refused = [value.reason for _, value in looked if not value.feasible]
        chosen = sorted((f for f in looked if f[1].feasible), key=lambda found: found[1].cost)
        taken: tuple[Scenario, Value, Report | None] = (scenario, before[1], None)
        end = started + effort.seconds
        lasted = 0.0
        while chosen and (begun := time.monotonic()) + lasted < end:
            report(sampler.done, total, "in closed loop")
            tried, chosen = chosen[: effort.workers], chosen[effort.workers :]
            reports = call(_run, packed, [candidate for candidate, _ in tried])
            passed = [i for i, r in enumerate(reports) if not isinstance(r, str)]
            refused += [r for r in reports[: passed[0] if passed else None] if isinstance(r, str)]
            lasted = time.monotonic() - begun
            if passed:
                taken = (*tried[passed[0]], reports[passed[0]])
                break
    return Placement(
        scenario=taken[0],
        goal=goal,
        before=before[1],
        after=taken[1],
        report=taken[2],
        refused=tuple(refused),
        history=tuple(sampler.history),
        in_time=sampler.in_time,
        seconds=time.monotonic() - started,
    )


class _Sampler:
    """The sampler: it asks for the costs of placements in batches, and stores them."""

    def __init__(self, start: Array, effort: Effort, deadline: float) -> None:
        self._start, self._effort, self._deadline = start, effort, deadline
        self._tried: list[tuple[float, Array]] = []
        self.history: list[tuple[int, float]] = []
        self.in_time = True

    @property
    def done(self) -> int:
        """Number of evaluations done."""
        return len(self._tried)

    def run(self, costs: Callable[[list[Array]], list[float]], report: SearchProgress) -> None:
        """Search until the evaluations or the time are used up, or the costs have converged."""
        rng = np.random.default_rng(self._effort.seed)
        # A Sobol sample is balanced only if its size is a power of two.
        size = min(_POPULATION, 2 ** int(math.log2(self._effort.evaluations)))
        first = qmc.Sobol(len(self._start), rng=rng).random(size)
        first[0] = self._start
        differential_evolution(
            lambda batch: self._take(list(batch.T.copy()), costs, report),
            [(0.0, 1.0)] * len(self._start),
            init=first,
            maxiter=self._effort.evaluations // size - 1,
            tol=0.0,
            atol=_ALIKE,
            polish=False,
            rng=rng,
            updating="deferred",
            vectorized=True,
            callback=lambda x, convergence: not self.in_time,
        )

    def _take(
        self,
        batch: list[Array],
        costs: Callable[[list[Array]], list[float]],
        report: SearchProgress,
    ) -> list[float]:
        if not self.in_time:  # the first sample has used up the time
            return [math.inf] * len(batch)
        found = costs(batch)
        self._tried += zip(found, batch, strict=True)
        least = min(cost for cost, _ in self._tried)
        self.history.append((self.done, least))
        total = max(self._effort.evaluations, self.done)
        report(self.done, total, f"cost {least:.4f}")
        self.in_time = time.monotonic() < self._deadline
        return found

    def best(self) -> list[Array]:
        """Return the placements of least cost that differ enough from each other."""
        found: list[Array] = []
        for _, x in sorted(self._tried, key=lambda tried: tried[0]):
            if all(np.abs(x - other).max() > _APART for other in found):
                found.append(x)
            if len(found) == _FINALISTS:
                break
        return found


@dataclass(frozen=True, eq=False)
class _Shared:
    """The data that all evaluations of a task share; they are computed once per process."""

    task: _Task
    moves: Moves
    tolerated: frozenset[Names]


@lru_cache(maxsize=4)
def _shared(packed: bytes) -> _Shared:
    task: _Task = pickle.loads(packed)
    return _Shared(task, Moves(task.scenario, task.freedom), touching(task.scenario))


def _cost(packed: bytes, x: Array) -> float:
    """Return the cost of a placement by coarse steps."""
    shared = _shared(packed)
    task, candidate = shared.task, shared.moves.scenario(x)
    return assess(candidate, task.control, task.goal, COARSE, shared.tolerated, whole=False).cost


def _look(packed: bytes, x: Array | None) -> tuple[Scenario, Value]:
    """Return a placement and its value over the full joint path; None for the given placement."""
    shared = _shared(packed)
    task, candidate = shared.task, shared.task.scenario
    if x is not None:
        candidate = shared.moves.scenario(x)
        with contextlib.suppress(PathError):  # the value reports it, too
            candidate = settled(candidate)
    return candidate, assess(candidate, task.control, task.goal, FULL, shared.tolerated)


def _run(packed: bytes, candidate: Scenario) -> Report | str:
    """Return the report of a placement's closed-loop run if it passes, else the reason."""
    task = _shared(packed).task
    try:
        report = execute(Request(candidate, task.controller, task.control)).report
    except FulcrumError as error:
        return str(error)
    return report if report.verdict is Verdict.PASS else "; ".join(report.sentences)


@contextlib.contextmanager
def _processes(count: int) -> Iterator[_Call]:
    """Yield a function that calls another one for each item of a sequence, on several processes."""
    if count == 1:
        yield lambda function, packed, each: [function(packed, one) for one in each]
        return
    with cluster(Workers(count)) as client:

        def call(function: Callable, packed: bytes, each: Sequence) -> list:
            tasks = [client.submit(function, packed, one, pure=False) for one in each]
            return client.gather(tasks)

        yield call
