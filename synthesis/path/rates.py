r"""How fast contact forces change along a path, and its limit as convex cones.

Forces are those at both ends of every interval, :math:`F_k^-` and :math:`F_k^+`. They jump between
intervals, for accelerations do, which are constant within and stand for the middle of each. So the
rate is that of the mean forces :math:`\bar F_k` from middle to middle, and neither the change
within an interval nor a jump is larger than what its time allows:

.. math::

    \|\bar F_{k+1} - \bar F_k\|,\ \|F_{k+1}^- - F_k^+\| \le \tfrac R2 (t_k + t_{k+1}), \quad
    \|F_k^+ - F_k^-\| \le R\,t_k, \quad
    t_k(b) = \frac{2 \Delta s_k}{\sqrt{b_k} + \sqrt{b_{k+1}}} .

Jumps vanish with the grid, and forces that are linear in time from middle to middle have none. At
an end at rest the forces that hold still, a = b = 0, are those of an interval without duration:
forces do not step when motion begins, but grow like any others. The moments that soft fingers
transmit are not limited.

The time is convex in b, for :math:`\sqrt b` is concave; the limit is not. But a convex function
lies above its tangents, so that about any pace :math:`b^*` that takes the times :math:`t_k^*`,

.. math::

    \|\Delta F\| \le R\,t_k^* \Bigl(1 - \sum_{j} \frac{b_j - b^*_j}{2\,\sigma_k \sqrt{b^*_j}}\Bigr)
    = R\,t_k^* \Bigl(\frac32 - \sum_{j} \frac{b_j}{2\,\sigma_k \sqrt{b^*_j}}\Bigr)
    \le R\,t_k(b), \quad \sigma_k = \sum_j \sqrt{b^*_j}, \quad j \in \{k, k+1\},

is a convex inner approximation, exact at :math:`b = b^*`. What keeps it keeps the limit; and solved
about a pace that keeps the limit it gives one that does, too, and is no worse. At an end at rest
b is a constant zero, and its term is left out.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.path.problem import Load, PathProblem
from fulcrum.synthesis.path.rows import Indices, Rows


def durations(s: Array, b: Array) -> Array:
    """How long each interval lasts [s], (K - 1,), at squared rates b of s [1/s^2], (K,)."""
    rate = np.sqrt(b)
    steps: Array = 2.0 * np.diff(s) / (rate[:-1] + rate[1:])
    return steps


def _differences(problem: PathProblem) -> tuple[sp.csr_array, sp.csr_array]:
    """Differences of the stations' forces, (D, S), and the times they may take, (D, K - 1)."""
    count = len(problem.s) - 1
    ends = sp.eye_array(2 * count + len(problem.rests)).tocsr()
    times = sp.eye_array(count).tocsr()
    first, second = ends[: 2 * count : 2], ends[1 : 2 * count : 2]
    means, between = (first + second) / 2.0, (times[:-1] + times[1:]) / 2.0
    changes = [second - first, first[1:] - second[:-1], means[1:] - means[:-1]]
    spans = [times, between, between]
    for rank, point in enumerate(problem.rests):
        near, k = (first, 0) if point == 0 else (second, count - 1)
        rest = ends[[2 * count + rank]]
        changes += [near[[k]] - rest, means[[k]] - rest]
        spans += [times[[k]] / 2.0] * 2
    return sp.vstack(changes).tocsr(), sp.vstack(spans).tocsr()


def force_rate_shares(problem: PathProblem, force_rate: float, b: Array, w_OC_C: Array) -> Array:
    """How much of a force rate each contact uses, (S, m): the most that a station has part in.

    Args:
        problem: The path, with more than one grid point.
        force_rate: [N/s].
        b: Squared rate of s at the grid points [1/s^2], (K,).
        w_OC_C: Wrenches in contact axes [N, N·m], (S, m, 6).
    """
    changes, spans = _differences(problem)
    forces = w_OC_C[..., : N + 1]
    change = (changes @ forces.reshape(len(forces), -1)).reshape(-1, *forces.shape[1:])
    largest = force_rate * (spans @ durations(problem.s, b))
    share = np.linalg.norm(change, axis=2) / largest[:, None]
    worst = np.zeros(forces.shape[:2])
    difference, station = changes.nonzero()
    np.maximum.at(worst, station, share[difference])
    return worst


class RateCones:
    """The cones of a path problem with a force rate, about a pace."""

    def __init__(self, rows: Rows, problem: PathProblem, pace: Array, time: float) -> None:
        """Works out what all contacts have in common.

        Args:
            rows: Where they go.
            problem: With a force rate and more than one grid point.
            pace: b [1/s^2], (K,), positive between the ends.
            time: Unit of time [s].
        """
        assert problem.force_rate is not None
        self._rows = rows
        changes, spans = _differences(problem)
        self._changes = changes.tocoo()
        steps, rate = durations(problem.s, pace), np.sqrt(pace)
        times = spans @ steps
        self._largest = problem.force_rate * times
        k = np.arange(len(steps))
        sides = 2.0 * (rate[:-1] + rate[1:])[:, None] * np.stack([rate[:-1], rate[1:]], axis=1)
        inverse = np.divide(1.0, sides, out=np.zeros_like(sides), where=sides > 0.0)
        slopes = sp.csr_array(
            (inverse.ravel(), (np.repeat(k, 2), np.stack([k, k + 1], axis=1).ravel()))
        )
        self._slopes = (
            sp.diags_array(1.0 / times) @ spans @ sp.diags_array(steps) @ slopes
        ).tocoo()
        self._slopes.data /= time**2
        self._s = (spans @ (steps * (problem.s[:-1] + problem.s[1:]) / 2.0)) / times

    def add(self, load: Load, columns: Indices, b: Indices, unit: float) -> None:
        r"""Adds :math:`\frac32 - \sum_j b_j / (2 \sigma_k \sqrt{b^*_j}) \ge
        \|\Delta F\| / (R\,t_k^*)` for all contacts of one load.

        Args:
            load: The load.
            columns: Of the contacts' transmitted components at the stations, (S, k).
            b: Columns of the squared rates at the grid points, (K,).
            unit: Of forces [N].
        """
        facts, (change, station) = load.problems[0].contact_set, self._changes.coords
        head, point = self._slopes.coords
        weight = self._changes.data * unit / self._largest[change]
        for i, contact in enumerate(load.problems[0].contacts):
            own = np.flatnonzero((facts.flat // 6 == i) & (facts.flat % 6 <= N))
            h = np.tile([1.5] + [0.0] * len(own), (len(self._s), 1))
            names, scale = [f"force rate of {contact.name}"] * h.shape[1], self._largest / unit
            rows = self._rows.new(h, self._s, names, scale=scale)
            self._rows.add(self._slopes.data, rows[head, 0], b[point])
            entries = weight[:, None] * facts.scale[own]
            self._rows.add(entries, rows[change, 1:], columns[station][:, own])
            self._rows.second_order(rows)
