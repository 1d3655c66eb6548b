r"""The time of a path's intervals as second-order cones.

Two cones bound the time of an interval, :math:`2 \Delta s / (\sqrt{b_k} + \sqrt{b_{k+1}})`
(Verscheure et al. 2009, (46) to (51)):

.. math:: c_k^2 \le b_k, \qquad 2 \Delta s_k \le t_k (c_k + c_{k+1})
"""

from __future__ import annotations

import math

import numpy as np

from fulcrum.synthesis.arrays import Array, Indices
from fulcrum.synthesis.path.rows import Rows


def timing_cones(rows: Rows, s: Array, b: Indices, c: Indices, t: Indices) -> None:
    r"""Add :math:`(1 + b) / 2 \ge \|(c, (1 - b) / 2)\|` and, with :math:`r = c_k + c_{k+1}`,
    :math:`(t + r) / 2 \ge \|(\sqrt 2, (t - r) / 2)\|`.

    Args:
        rows: Program to which the cones are added.
        s: Grid points, (K,).
        b, c: Columns of squared rates and rates at the grid points, (K,).
        t: Columns of the times of the intervals, (K - 1,).
    """
    # Rates are in units of the mean rate of the path in one timescale: all numbers are about 1.
    mean = s[-1] - s[0]
    share = np.diff(s) / mean
    # Rates at the ends are constants: their cones would have no interior, and are not needed.
    if len(s) > 2:
        inner = rows.new(np.tile([0.5, 0.0, 0.5], (len(s) - 2, 1)), s[1:-1], [""] * 3)
        rows.add(-0.5 / mean**2, inner[:, 0], b[1:-1])
        rows.add(-1.0 / mean, inner[:, 1], c[1:-1])
        rows.add(0.5 / mean**2, inner[:, 2], b[1:-1])
        rows.second_order(inner)
    h = np.tile([0.0, math.sqrt(2.0), 0.0], (len(share), 1))
    times = rows.new(h, s[:-1], [""] * 3)
    for column in (c[:-1], c[1:]):
        rows.add(-0.5 / mean, times[:, 0], column)
        rows.add(0.5 / mean, times[:, 2], column)
    rows.add(-0.5 / share, times[:, 0], t)
    rows.add(-0.5 / share, times[:, 2], t)
    rows.second_order(times)
