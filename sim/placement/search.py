"""Where to stand and where to hold: placements sought by differential evolution of the synthesis.

Robot base, contact places, turns of the hands and start posture are numbers x in a unit cube
(:mod:`sim.placement.freedom`); what a placement is worth at a few tilts is one number to be
minimised (:mod:`sim.placement.value`). Differential evolution begins with a Sobol sample of the
cube. The best few are then looked at over the full joint path and run in closed loop; the first
that stands both and costs less than the placement given wins.

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

from fulcrum.sim.evaluation.report import Report, Verdict
from fulcrum.sim.model.links import Names
from fulcrum.sim.motion.joint_path import PathError
from fulcrum.sim.placement.freedom import Freedom, Moves
from fulcrum.sim.placement.value import COARSE, FULL, Goal, Value, assess, settled, touching
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.run.workers import Workers, cluster
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.control import controller as control_named
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.synthesis import FulcrumError
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.checks import positive, whole

# Placements of a generation, at most and at least: even shares for 1, 2 and 4 processes.
_POPULATION, _LEAST = 32, 8
# The search ends when the costs of a generation lie as near together as this.
_ALIKE = 1e-5
# Candidates looked at in full, and how far apart they are, at least, in some number [-].
_FINALISTS, _APART = 4, 0.01
# What has to be gained, as a share of the cost: less is noise.
_GAIN = 1e-3
# Share of the time that is kept for the candidates.
_KEPT = 0.35

# Called with evaluations done and in total, and a note.
SearchProgress = Callable[[int, int, str], None]
# Calls a function with a task and each of some others, on all processes.
_Call = Callable[[Callable, bytes, Sequence], list]


@dataclass(frozen=True)
class Effort:
    """How long is sought.

    The same seed gives the same placement, unless the time ends before the evaluations.

    Attributes:
        evaluations: Placements that are looked at, at most; at least 8.
        seconds: Time for everything [s].
        seed: Draws the samples.
        workers: Processes; 1 is the present one.
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
    """What a search found.

    Attributes:
        scenario: The scene as it is best placed; the one given if nothing better was found.
        goal: What was sought.
        before, after: What the given and the best placement are worth over the full joint path.
        report: Of the best one's closed-loop run; None if nothing better was found.
        refused: Why better candidates were not taken, the best first.
        history: Evaluations done, and the least cost so far, after every sample.
        in_time: Whether the search came to its end before its time did.
        seconds: How long it took [s].
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
    """What every evaluation needs."""

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
    """Seeks the best placement.

    Args:
        scenario: The scene as it is placed now, well or badly.
        controller: Whose margins count, and who runs what was found.
        goal: What is sought.
        freedom: What may move.
        effort: How long is sought.
        progress: Called after every sample.

    Raises:
        InvalidInputError: Nothing may move, or not as the freedom says, or there is no such
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
    """Asks for placements in batches, and keeps what they cost."""

    def __init__(self, start: Array, effort: Effort, deadline: float) -> None:
        self._start, self._effort, self._deadline = start, effort, deadline
        self._tried: list[tuple[float, Array]] = []
        self.history: list[tuple[int, float]] = []
        self.in_time = True

    @property
    def done(self) -> int:
        """Evaluations done."""
        return len(self._tried)

    def run(self, costs: Callable[[list[Array]], list[float]], report: SearchProgress) -> None:
        """Searches until the evaluations or the time are used up, or nothing changes any more."""
        rng = np.random.default_rng(self._effort.seed)
        # A Sobol sample is even if its size is a power of two.
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
        if not self.in_time:  # the first sample has used it up
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
        """The placements that cost least, no two alike."""
        found: list[Array] = []
        for _, x in sorted(self._tried, key=lambda tried: tried[0]):
            if all(np.abs(x - other).max() > _APART for other in found):
                found.append(x)
            if len(found) == _FINALISTS:
                break
        return found


@dataclass(frozen=True, eq=False)
class _Shared:
    """What all evaluations of a task have in common: found once per process."""

    task: _Task
    moves: Moves
    tolerated: frozenset[Names]


@lru_cache(maxsize=4)
def _shared(packed: bytes) -> _Shared:
    task: _Task = pickle.loads(packed)
    return _Shared(task, Moves(task.scenario, task.freedom), touching(task.scenario))


def _cost(packed: bytes, x: Array) -> float:
    """Of a placement, looked at coarsely."""
    shared = _shared(packed)
    task, candidate = shared.task, shared.moves.scenario(x)
    return assess(candidate, task.control, task.goal, COARSE, shared.tolerated, whole=False).cost


def _look(packed: bytes, x: Array | None) -> tuple[Scenario, Value]:
    """A placement, and what it is worth over the full joint path; None is the one given."""
    shared = _shared(packed)
    task, candidate = shared.task, shared.task.scenario
    if x is not None:
        candidate = shared.moves.scenario(x)
        with contextlib.suppress(PathError):  # which the value says, too
            candidate = settled(candidate)
    return candidate, assess(candidate, task.control, task.goal, FULL, shared.tolerated)


def _run(packed: bytes, candidate: Scenario) -> Report | str:
    """The report of a placement's closed-loop run if it passes, else why it does not."""
    task = _shared(packed).task
    try:
        report = execute(Request(candidate, task.controller, task.control)).report
    except FulcrumError as error:
        return str(error)
    return report if report.verdict is Verdict.PASS else "; ".join(report.failures)


@contextlib.contextmanager
def _processes(count: int) -> Iterator[_Call]:
    """What calls a function with each of some second arguments, on so many processes."""
    if count == 1:
        yield lambda function, packed, each: [function(packed, one) for one in each]
        return
    with cluster(Workers(count)) as client:

        def call(function: Callable, packed: bytes, each: Sequence) -> list:
            tasks = [client.submit(function, packed, one, pure=False) for one in each]
            return client.gather(tasks)

        yield call
