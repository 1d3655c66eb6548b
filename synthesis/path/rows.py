"""Rows of a sparse conic program, added block by block, with the names of their limits."""

from __future__ import annotations

from collections.abc import Iterator

import clarabel
import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis.arrays import Array, Indices


class Rows:
    r"""Data of :math:`Ax + s = h,\ s \in \mathcal{K}`: equalities, inequalities, cones, in order.

    Attributes:
        cones: Clarabel's cones.
    """

    def __init__(self) -> None:
        self.cones: list[clarabel.ZeroConeT] = []
        self._named: list[tuple[Indices, Array, tuple[list[str], ...]]] = []
        self._entries: list[tuple[Array, Indices, Indices]] = []
        self._h: list[Array] = []
        self._shifts: list[tuple[Indices, Array]] = []
        self._count = 0
        self._nonnegative = slice(0, 0)
        self._second_order: list[Indices] = []

    def new(self, h: Array, s: Array, *names: list[str]) -> Indices:
        """Return new row numbers, (places, r).

        Args:
            h: Right-hand sides, (places, r).
            s: Places on the path, (places,); NaN for a constraint on the whole path.
            names: Names of the r rows at each place, or once for all places; "" for rows that are
                not limits.
        """
        rows = self._count + np.arange(h.size).reshape(h.shape)
        self._count += h.size
        self._h.append(h.ravel())
        self._named.append((rows, s, names))
        return rows

    def add(self, data: Array | float, rows: Indices, columns: Indices) -> None:
        """Add entries, with broadcasting; entries at the same place are summed."""
        data, rows, columns = np.broadcast_arrays(data, rows, columns)
        self._entries.append((data.ravel(), rows.ravel(), columns.ravel()))

    def shift(self, rows: Indices, constant: Array) -> None:
        """Add a constant, in the shape of the rows, to the left side of the rows."""
        self._shifts.append((rows.ravel(), constant.ravel()))

    def add_block(self, A: Array, rows: Indices, columns: Indices) -> None:
        """Add matrices A, (places, r, k), in rows, (places, r), and columns, (places, k)."""
        r, k = np.nonzero((A != 0.0).any(axis=0))
        self.add(A[:, r, k], rows[:, r], columns[:, k])

    def end_equalities(self) -> None:
        """Mark all rows so far as equalities."""
        self.cones.append(clarabel.ZeroConeT(self._count))
        self._nonnegative = slice(self._count, self._count)

    def end_inequalities(self) -> None:
        """Mark all rows since the equalities as inequalities."""
        self._nonnegative = slice(self._nonnegative.start, self._count)
        if count := self._count - self._nonnegative.start:
            self.cones.append(clarabel.NonnegativeConeT(count))

    def second_order(self, rows: Indices) -> None:
        """Mark the next rows, (cones, k), as second-order cones, each with its head first."""
        self.cones += [clarabel.SecondOrderConeT(rows.shape[1])] * len(rows)
        self._second_order.append(rows)

    def data(self, columns: int) -> tuple[sp.csc_matrix, Array]:
        """Return A and h."""
        data, rows, where = (np.concatenate(each) for each in zip(*self._entries, strict=True))
        A = sp.csc_matrix((data, (rows, where)), shape=(self._count, columns))
        h = np.concatenate(self._h)
        for rows_shifted, constant in self._shifts:
            np.subtract.at(h, rows_shifted, constant)
        return A, h

    def dual_violation(self, z: Array) -> float:
        """Return the largest distance of multipliers from the dual cones; 0 or less inside."""
        worst = float(-z[self._nonnegative].min(initial=0.0))
        for rows in self._second_order:
            outside = np.linalg.norm(z[rows[:, 1:]], axis=1) - z[rows[:, 0]]
            worst = max(worst, float(outside.max()))
        return worst

    def weights(self, z: Array) -> Iterator[tuple[float, float, str]]:
        """Yield the size of the multiplier of each limit, its place and its name."""
        for rows, places, names in self._named:
            for k, s in enumerate(places):
                for row, name in zip(rows[k], names[k if len(names) > 1 else 0], strict=True):
                    if name:
                        yield abs(float(z[row])), float(s), name
