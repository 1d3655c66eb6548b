"""What a sweep's rows come to: how often each controller succeeds, and why not always."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from scipy.stats import binomtest

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class FailureCause:
    """What failures began with.

    Attributes:
        cause: Category, and contact or joint.
        episodes: How many.
        share: Of all episodes of the controller [-].
        replay: The command that shows the first of them.
    """

    cause: str
    episodes: int
    share: float
    replay: str


@dataclass(frozen=True)
class Score:
    """One controller in all worlds.

    Attributes:
        controller: Name.
        episodes: How many there were.
        successes: How many of them passed.
        rate: Their share [-].
        low, high: 95 % confidence interval of the rate (Clopper and Pearson 1934, exact) [-].
        grip_n: Median over the episodes of the largest normal force of a hand [N].
        grip_max_n: The largest of all [N].
        friction: Median over the episodes of the largest share of its friction that a hand used
            while it held [-]; at 1 it slides.
        force_error_n: The same of the RMS error of a hand's normal force [N].
        causes: Of its failures, most frequent first.
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
    """The scores of the controllers, in the order in which they come.

    Args:
        rows: At least one.
        hands: Names of the hands.
    """
    every = rows.to_pylist()
    names = dict.fromkeys(row["controller"] for row in every)
    return tuple(_score(n, [r for r in every if r["controller"] == n], hands) for n in names)


def _score(name: str, rows: list[dict], hands: tuple[str, ...]) -> Score:
    successes = sum(row["success"] for row in rows)
    interval = binomtest(successes, len(rows)).proportion_ci(_CONFIDENCE, method="exact")
    # Episodes that ended in an error have no figures.
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
