"""The summary of a sweep: success rate and causes of failure of each controller."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from scipy.stats import binomtest

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class FailureCause:
    """A cause of failures.

    Attributes:
        cause: Category of the first failure, and its contact or joint.
        episodes: Number of episodes with this cause.
        share: Their share of all episodes of the controller [-].
        replay: Command that replays the first of them.
    """

    cause: str
    episodes: int
    share: float
    replay: str


@dataclass(frozen=True)
class Score:
    """The score of one controller in all worlds.

    Attributes:
        controller: Name of the controller.
        episodes: Number of episodes.
        successes: Number of episodes that passed.
        rate: Share of episodes that passed [-].
        low, high: 95 % confidence interval of the rate (Clopper and Pearson 1934, exact) [-].
        grip_n: Median over the episodes of the largest normal force of a hand [N].
        grip_max_n: Largest normal force of a hand in all episodes [N].
        friction: Median over the episodes of the largest share of its friction that a hand used
            while it held [-]; at 1 it slides.
        force_error_n: Median over the episodes of the largest RMS error of a hand's normal force
            [N].
        causes: Causes of the failures, most frequent first.
    """

    controller: str
    episodes: int
    successes: int
    rate: float
    low: float
    high: float
    grip_n: float
    grip_max_n: float
    friction: float
    force_error_n: float
    causes: tuple[FailureCause, ...]


def scores(rows: pa.Table, hands: tuple[str, ...]) -> tuple[Score, ...]:
    """Return the scores of the controllers, in the order of their first rows.

    Args:
        rows: Table of the episodes, at least one.
        hands: Names of the hands.
    """
    every = rows.to_pylist()
    names = dict.fromkeys(row["controller"] for row in every)
    return tuple(_score(n, [r for r in every if r["controller"] == n], hands) for n in names)


def _score(name: str, rows: list[dict], hands: tuple[str, ...]) -> Score:
    successes = sum(row["success"] for row in rows)
    interval = binomtest(successes, len(rows)).proportion_ci(_CONFIDENCE, method="exact")
    # Episodes that ended in an error have no measurements.
    done = [row for row in rows if row.get(f"contacts.{hands[0]}.max_normal_n") is not None]
    grips, friction, errors = (
        [max(row[f"contacts.{hand}.{figure}"] for hand in hands) for row in done] or [0.0]
        for figure in ("max_normal_n", "max_utilisation", "force_error_rms_n")
    )
    first: dict[str, str] = {}
    for row in rows:
        if row["cause"] is not None:
            first.setdefault(row["cause"], row["replay"])
    counts = Counter(row["cause"] for row in rows if row["cause"] is not None)
    return Score(
        controller=name,
        episodes=len(rows),
        successes=successes,
        rate=successes / len(rows),
        low=float(interval.low),
        high=float(interval.high),
        grip_n=float(np.median(grips)),
        grip_max_n=max(grips),
        friction=float(np.median(friction)),
        force_error_n=float(np.median(errors)),
        causes=tuple(
            FailureCause(cause, n, n / len(rows), first[cause]) for cause, n in counts.most_common()
        ),
    )
