r"""The path problem in the conic standard form that Clarabel solves.

Variables, in this order: b at the grid points, c at the grid points, the time t of each interval,
the forces of every station and load as in :mod:`synthesis.conic`, the torque utilisations (least
effort only) and :math:`\lambda` (friction margin only). The normal forces of the hands have the
same columns for all loads, b and c at the ends are constants, and a is eliminated by
:math:`a_k = (b_{k+1} - b_k) / (2 \Delta s_k)`. :mod:`synthesis.path.cones` relates t, c and b.

Viscous friction is computed with c, which is exact where time presses c to :math:`\sqrt b`.
Elsewhere the problem is solved again about the last solution :math:`\bar b`, with the tangent
:math:`(b / \sqrt{\bar b} + \sqrt{\bar b}) / 2 \ge \sqrt b` for the rate.

In :math:`\min \tfrac12 x^T P x + q^T x,\ Ax + s = h,\ s \in \mathcal{K}`, the rows are

==========================  =========================================================
equilibrium                 of every station and load
utilisations (effort only)  :math:`u = 2\tau / (\tau_{max} - \tau_{min})`
bounds                      of normal forces and torques, of every station and load
rates                       :math:`b_k \le b_{max,k}`
duration                    :math:`\sum t_k \le T`
first margin                :math:`\lambda \le 0` (friction margin, first solve only)
cones                       friction; :math:`c_k`; :math:`t_k`; accelerations
==========================  =========================================================

Forces are in units of the largest load, times of :meth:`PathProblem.timescale`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis import Objective
from fulcrum.synthesis.arrays import Array, Indices, Mask
from fulcrum.synthesis.conic import ConicForm
from fulcrum.synthesis.path.cones import timing_cones
from fulcrum.synthesis.path.limits import Accelerations
from fulcrum.synthesis.path.problem import Load, PathObjective, PathProblem
from fulcrum.synthesis.path.rows import Rows


class _Block(NamedTuple):
    """Matrices of (17) of one load at all grid points, and the columns of its forces."""

    load: Load
    form: ConicForm
    A: Array  # (K, rows of the form, columns)
    b: Array  # (K, rows of the form), in the unit of the path's form
    columns: Indices  # (S, columns)


class PathForm:
    """Matrices of one path problem.

    Attributes:
        problem: The problem.
        rows: Rows with their names and places.
        P, q: Data of the objective.
        unit: Unit of forces and torques [N or N·m].
    """

    def __init__(
        self,
        problem: PathProblem,
        reference: Array | None = None,
        grip: Array | None = None,
        where: Mask | None = None,
    ) -> None:
        """Assemble the matrices.

        Args:
            problem: The problem.
            reference: b for the tangent of viscous friction [1/s^2], (K,); None to use c.
            grip: Given normal forces of the n hands [N], (S, n); None if they are variables.
            where: Mask of the stations to use if the timing is given, (S,); None for all. From
                here on S is their number.
        """
        self.problem, self._reference, self._grip = problem, reference, grip
        self.rows = Rows()
        self.unit = max(p.load for load in problem.loads for p in load.problems) or 1.0
        self._time = problem.timescale()
        self._margin = problem.objective is PathObjective.FRICTION_MARGIN
        self._effort = problem.objective is PathObjective.LEAST_EFFORT
        self._points, self._ds = len(problem.s), np.diff(problem.s)
        self._timed = self._points > 1 and problem.timing is None
        stations = problem.stations
        self._point, self._interval = (stations if where is None else stations[where]).T
        joints = problem.loads[0].problems[0].joints
        self._joints = () if joints is None else joints.names
        self._blocks = self._lay_out_columns()
        self._equalities()
        self._inequalities()
        self._second_order_cones()
        self._finish()

    def _lay_out_columns(self) -> list[_Block]:
        points, stations = self._points, len(self._point)
        self._b, self._c = np.arange(points), points + np.arange(points)
        self._t = 2 * points + np.arange(points - 1)
        end = 3 * points - 1
        # With a margin all contacts have rows for their preload: see fulcrum.synthesis.conic.
        objective = Objective.FRICTION_MARGIN if self._margin else Objective.NORM_NORMAL_FORCE
        blocks: list[_Block] = []
        for load in self.problem.loads:
            form = ConicForm(replace(load.problems[0], objective=objective))
            own = np.ones(form.aux_column, bool)
            own[form.hand_normals] = not blocks
            count = stations * int(own.sum())
            columns = np.empty((stations, form.aux_column), np.intp)
            columns[:, own] = end + np.arange(count).reshape(stations, -1)
            if blocks:
                columns[:, ~own] = blocks[0].columns[:, blocks[0].form.hand_normals]
            end += count
            pairs = [form.matrices(problem) for problem in load.problems]
            A = np.stack([A[:, : form.aux_column] for A, _ in pairs])
            b = [b * p.unit for (_, b), p in zip(pairs, load.problems, strict=True)]
            blocks.append(_Block(load, form, A, np.stack(b) / self.unit, columns))
        shape = len(blocks), stations, len(self._joints) if self._effort else 0
        self._u = end + np.arange(math.prod(shape)).reshape(shape)
        self._aux = end + self._u.size
        self._columns = self._aux + int(self._margin)
        return blocks

    def _add_motion(
        self, rows: Indices, per_a: Array, per_b: Array, per_c: Array | None = None
    ) -> None:
        """Add terms in a, b and c at the stations, (S, r) each, per 1/s^2 and 1/s."""
        if self._points == 1:
            return
        slope = per_a / (2.0 * self._ds[self._interval, None] * self._time**2)
        self.rows.add(slope, rows, self._b[self._interval + 1][:, None])
        self.rows.add(-slope, rows, self._b[self._interval][:, None])
        self.rows.add(per_b / self._time**2, rows, self._b[self._point][:, None])
        if per_c is None:
            return
        if self._reference is None:
            self.rows.add(per_c / self._time, rows, self._c[self._point][:, None])
            return
        rate = np.sqrt(self._reference[self._point])[:, None]
        # At the ends, where a rate may be zero, b is that of the reference.
        slope = np.divide(0.5, rate, out=np.zeros_like(rate), where=rate > 0.0)
        self.rows.add(per_c * slope / self._time**2, rows, self._b[self._point][:, None])
        self.rows.shift(rows, per_c * rate / 2.0)

    def _inertial_torques(self) -> tuple[Array, Array, Array]:
        """Return tau_a, tau_b and tau_c at the stations, (S, l) each."""
        assert self.problem.inertial_torques is not None
        own = self.problem.inertial_torques.at(self._point)
        return own.tau_a, own.tau_b, own.tau_c

    def _equalities(self) -> None:
        point, s = self._point, self.problem.s[self._point]
        for load, form, A, b, columns in self._blocks:
            balance = form.equilibrium_rows
            rows = self.rows.new(b[point][:, balance], s, [""] * 6)
            self.rows.add_block(A[point][:, balance], rows, columns)
            self._add_motion(rows, -load.w_a_B[point] / self.unit, -load.w_b_B[point] / self.unit)
        if self._effort:
            for block, u in zip(self._blocks, self._u, strict=True):
                self._utilisations(block, u)
        self.rows.end_equalities()

    def _utilisations(self, block: _Block, u: Indices) -> None:
        """Add the rows u = 2 tau / (tau_max - tau_min)."""
        form, load, point = block.form, block.load, self._point
        half = ((load.tau_max - load.tau_min) / 2.0)[point]
        tau_g = np.stack([j.tau_g for j in load.joints])[point]
        J = np.stack([j.J_C for j in load.joints]).reshape(len(load.joints), -1, half.shape[1])
        J = J[:, form.hand_flat][point]
        scale = load.problems[0].contact_set.scale[form.hand_columns] * self.unit
        names = [""] * len(self._joints)
        rows = self.rows.new(-tau_g / half, self.problem.s[point], names)
        J_scaled = J.transpose(0, 2, 1) * scale / half[:, :, None]
        self.rows.add_block(J_scaled, rows, block.columns[:, form.hand_columns])
        self._add_motion(rows, *(term / half for term in self._inertial_torques()))
        self.rows.add(-1.0, rows, u)

    def _inequalities(self) -> None:
        problem = self.problem
        for block in self._blocks:
            self._bounds(block)
        if problem.rates is not None and self._timed:
            largest, names = problem.rates.largest()
            limited = np.flatnonzero(np.isfinite(largest))
            named = [[f"speed of {names[k]}"] for k in limited]
            rows = self.rows.new(np.ones((len(limited), 1)), problem.s[limited], *named)
            self.rows.add(1.0 / (largest[limited] * self._time**2), rows[:, 0], self._b[limited])
        everywhere = np.array([np.nan])
        if math.isfinite(problem.duration) and self._timed:
            h = np.full((1, 1), problem.duration / self._time)
            self.rows.add(1.0, self.rows.new(h, everywhere, ["duration"])[0], self._t)
        if self._margin:
            self._margin_row = self.rows.new(np.zeros((1, 1)), everywhere, [""])[0]
            self.rows.add(1.0, self._margin_row, np.array([self._aux]))
        self.rows.end_inequalities()

    def _bounds(self, block: _Block) -> None:
        load, form, A, b, columns = block
        point, bounds = self._point, form.bound_rows
        scale = 1.0 / np.maximum(1.0, np.abs(b[:, bounds]))
        contacts = [contact.name for contact in load.problems[0].contacts]
        names = [f"f_n_min of {contacts[i]}" for i in form.preloaded]
        names += [f"f_n_max of {contacts[i]}" for i in form.limited]
        limits = np.concatenate([form.upper, form.lower])
        names += [f"torque of {self._joints[j]}" for j in limits]
        rows = self.rows.new((b[:, bounds] * scale)[point], self.problem.s[point], names)
        self.rows.add_block((A[:, bounds] * scale[..., None])[point], rows, columns)
        if len(limits):
            torques = slice(rows.shape[1] - len(limits), None)
            sign = np.repeat([1.0, -1.0], [len(form.upper), len(form.lower)]) / self.unit
            factor = sign * scale[point][:, torques]
            terms = (term[:, limits] * factor for term in self._inertial_torques())
            self._add_motion(rows[:, torques], *terms)

    def _second_order_cones(self) -> None:
        self._heads: list[Indices] = []
        s = self.problem.s[self._point]
        for load, form, A, b, columns in self._blocks:
            contacts, heads = load.problems[0].contacts, []
            for (i, width), start in zip(form.cones, form.cone_heads, strict=True):
                own = slice(start, start + width)
                names = [f"friction of {contacts[i].name}"] * width
                rows = self.rows.new(b[self._point][:, own], s, names)
                self.rows.add_block(A[self._point][:, own], rows, columns)
                self.rows.second_order(rows)
                heads.append(rows[:, 0])
            self._heads.append(np.stack(heads, axis=1) if heads else np.zeros((0, 0), np.intp))
        if self._timed:
            timing_cones(self.rows, self.problem.s, self._b, self._c, self._t)
            if self.problem.accelerations is not None:
                self._acceleration_cones(self.problem.accelerations)

    def _acceleration_cones(self, limited: Accelerations) -> None:
        point = self._point
        for j in np.flatnonzero(np.isfinite(limited.limits)):
            h = np.tile([1.0, 0.0, 0.0, 0.0], (len(point), 1))
            names = [f"acceleration of {limited.names[j]}"] * 4
            rows = self.rows.new(h, self.problem.s[point], names)
            vectors = limited.slopes[point, j], limited.curvatures[point, j]
            self._add_motion(rows[:, 1:], *(each / limited.limits[j] for each in vectors))
            self.rows.second_order(rows)

    def _finish(self) -> None:
        """Set A and h, with constants moved to the right side, and P and q."""
        whole, h = self.rows.data(self._columns)
        problem = self.problem
        b, fixed = np.zeros(self._points), np.zeros(self._columns, bool)
        if self._timed:
            ends = [0, -1]
            b[ends] = problem.start_rate**2, problem.end_rate**2
            fixed[self._b[ends]] = fixed[self._c[ends]] = True
        else:
            b = b if problem.timing is None else problem.timing
            fixed[: self._t.size + 2 * self._points] = True
        self._constant = np.zeros(self._columns)
        self._constant[self._b] = b * self._time**2
        self._constant[self._c] = np.sqrt(b) * self._time
        if self._grip is not None:
            _, form, _, _, columns = self._blocks[0]
            hands = columns[:, form.hand_normals]
            fixed[hands], self._constant[hands] = True, self._grip / self.unit
        self._free = np.flatnonzero(~fixed)
        self._h = h - whole @ self._constant
        self._A = whole[:, self._free]
        self._A.eliminate_zeros()  # a tenth of the entries, which would cost the solver time
        q, P = np.zeros(self._columns), np.zeros(self._columns)
        q[self._t] = float(problem.objective is PathObjective.LEAST_TIME)
        if self._margin:
            q[self._aux] = 1.0
        if self._effort:
            P[self._u] = 2.0 * self._weights()[:, None]
        self.q = q[self._free]
        self.P = sp.diags_array(P[self._free]).tocsc()

    def _weights(self) -> Array:
        """Return the share of each station in the mean over path and loads, (S,)."""
        share = np.ones(1)
        if self._points > 1:
            share = np.repeat(self._ds / self._ds.sum() / 2.0, 2)
        return share / len(self._blocks)

    def matrices(self, utilisation: float, slack: list[Array] | None) -> tuple[Any, Array]:
        """Return A and h; for a friction margin with its parameters s and d.

        Args:
            utilisation: Parameter s [-].
            slack: Parameters d of each load [N], (S, m); None for the first problem, with
                lambda <= 0.
        """
        if not self._margin:
            return self._A, self._h
        change = Rows()
        change.new(np.zeros((len(self._h), 1)), np.zeros(0))
        for i, (block, heads) in enumerate(zip(self._blocks, self._heads, strict=True)):
            contacts = block.form.cone_contacts
            normals = block.columns[:, block.form.normal_columns[contacts]]
            change.add(1.0 - utilisation, heads, normals)
            d = np.ones(heads.shape) if slack is None else slack[i][:, contacts] / self.unit
            change.add(-d, heads, np.array(self._aux))
        h = self._h.copy()
        h[self._margin_row] = 0.0 if slack is None else 1.0
        return self._A + change.data(self._columns)[0][:, self._free], h

    def completed(self, x: Array) -> Array:
        """Return all variables, from those of the solver and the constants."""
        every = self._constant.copy()
        every[self._free] = x
        return every

    def squared_rates(self, every: Array) -> Array:
        """Return b at the grid points [1/s^2], (K,)."""
        return every[self._b] / self._time**2

    def wrenches(self, every: Array) -> tuple[Array, ...]:
        """Return the contact wrenches with each load [N, N·m], (S, m, 6)."""
        found = []
        for load, form, _, _, columns in self._blocks:
            w_OC_C = np.zeros((len(self._point), 6 * form.m))
            scale = load.problems[0].contact_set.scale * self.unit
            w_OC_C[:, form.flat] = every[columns] * scale
            found.append(w_OC_C.reshape(-1, form.m, 6))
        return tuple(found)

    def value(self, every: Array) -> float:
        """Return the duration [s], or the mean squared effort [-]."""
        if self._effort:
            return float(((every[self._u] ** 2).sum(axis=2) @ self._weights()).sum())
        return float(every[self._t].sum()) * self._time
