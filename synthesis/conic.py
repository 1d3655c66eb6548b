r"""Problem (17) in the conic standard form that Clarabel solves.

The variables are the transmitted components of every contact wrench, scaled by
:attr:`Contact.scale` so that each friction cone becomes the standard second-order cone, and one
auxiliary scalar :math:`\lambda` that bounds the objective. Joint torques are eliminated by (15):
:math:`\tau = J^T F_C + \tau_g`. In the form :math:`\min q^T x,\ Ax + s = b,\ s \in \mathcal{K}`,
the rows are, in this order,

======================  ======================================================  ===================
rows                    constraint                                              multiplier
======================  ======================================================  ===================
6                       :math:`G F + w_{ext} = 0`                               equilibrium
preloaded contacts      :math:`f_n \ge F_{n,min}`                               f_n_min
limited contacts        :math:`f_n \le F_{n,max}`                               f_n_max
limited joints          :math:`\tau \le \tau_{max}`                             tau_max
limited joints          :math:`\tau \ge \tau_{min}`                             tau_min
objective, linear       :math:`F_n \le \lambda`, :math:`|\tau_k| \le \lambda c_k`  objective
objective, cone         :math:`\|F_n\| \le \lambda` or :math:`\|\tau\| \le \lambda`  objective
k per contact           :math:`f_i \in \mathcal{K}_i`                           cone
======================  ======================================================  ===================

For the friction margin the cones read :math:`\|f_t\| \le s f_n + \lambda d_i` with parameters
:math:`s, d_i`, and all contacts count as preloaded, for at :math:`s = 0` the cones leave
:math:`f_n` free; see :mod:`synthesis.synthesizer`.

Without the torque limits the form is a relaxation, with two thirds fewer entries for
two arms of seven joints; see :mod:`synthesis.synthesizer`.

All forces and torques are in units of :meth:`ConicForm.force_unit`, so that the solver's tolerances
are relative to the load. The equations are homogeneous in them: A does not change.
"""

from __future__ import annotations

from collections.abc import Hashable
from itertools import pairwise
from typing import Any

import clarabel
import numpy as np
from numpy.typing import NDArray

from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.problem import Objective, Problem
from fulcrum.synthesis.solution import Multipliers

_LINEAR_IN_TORQUE = (Objective.MAX_TORQUE, Objective.MAX_TORQUE_UTILISATION)


def structure(problem: Problem, torque_limits: bool = True) -> Hashable:
    """What two problems must share to be solved by the same prebuilt solver."""
    joints = problem.joints
    limits: Hashable = None
    if joints is not None and torque_limits:
        limits = np.isfinite(joints.tau_min).tobytes(), np.isfinite(joints.tau_max).tobytes()
    return (
        problem.contact_set.structure,
        problem.objective,
        0 if joints is None else len(joints.names),
        limits,
    )


class ConicForm:
    """Index maps of one problem structure, made once; numbers flow through them at each solve."""

    def __init__(self, problem: Problem, torque_limits: bool = True) -> None:
        """Lays out rows and columns.

        Args:
            problem: Any problem of the structure.
            torque_limits: Whether (16) has rows; without them the form is a relaxation.
        """
        contacts, joints, objective = problem.contacts, problem.joints, problem.objective
        facts = problem.contact_set
        widths, starts = facts.widths, facts.starts
        self.m = len(contacts)
        self.objective = objective
        self.normal_columns = starts[:-1]
        self.aux_column = int(starts[-1])
        self.columns = self.aux_column + 1
        # Flat position in the (m, 6) wrenches of each variable.
        self.flat = facts.flat
        hands = list(facts.hands)
        self.hand_columns = np.flatnonzero(np.isin(self.flat // 6, hands))
        hand_rank = {i: rank for rank, i in enumerate(hands)}
        self.hand_flat = np.array(
            [6 * hand_rank[f // 6] + f % 6 for f in self.flat[self.hand_columns]], dtype=np.intp
        )
        self.hand_normals = self.normal_columns[hands]
        # Flat position in the (m, 6, 6) grasp maps of each entry of the equilibrium rows.
        contact, component = np.divmod(self.flat, 6)
        self._G_entries = 36 * contact + 6 * np.arange(6)[:, None] + component

        margin = objective is Objective.FRICTION_MARGIN
        preloaded = [
            c.f_n_min > 0.0 or w == 1 or margin for c, w in zip(contacts, widths, strict=True)
        ]
        self.preloaded = np.flatnonzero(preloaded)
        self.limited = np.flatnonzero(np.isfinite(facts.f_n_max))
        self._bounds = np.concatenate([self.preloaded, len(contacts) + self.limited])
        none = np.zeros(0, dtype=np.intp)
        bounded = joints if torque_limits else None
        self.upper = none if bounded is None else np.flatnonzero(np.isfinite(bounded.tau_max))
        self.lower = none if bounded is None else np.flatnonzero(np.isfinite(bounded.tau_min))
        self.cones = [(i, w) for i, w in enumerate(widths) if w > 1]
        self._needs_torque = bool(self.upper.size or self.lower.size or objective.needs_joints)
        self._lay_out_rows(0 if joints is None else len(joints.names), starts, widths)
        self._lay_out_multipliers(0 if joints is None else len(joints.names), facts.f_n_min)
        self._constant = self._constant_entries()

    def _lay_out_rows(self, l: int, starts: Array, widths: tuple[int, ...]) -> None:
        linear = {
            Objective.MAX_NORMAL_FORCE: len(self.hand_normals),
            Objective.MAX_TORQUE: 2 * l,
            Objective.MAX_TORQUE_UTILISATION: 2 * l,
            Objective.FRICTION_MARGIN: 1,
        }.get(self.objective, 0)
        cone = {
            Objective.NORM_NORMAL_FORCE: 1 + len(self.hand_normals),
            Objective.NORM_TORQUE: 1 + l,
        }.get(self.objective, 0)
        sizes = [6, len(self.preloaded), len(self.limited), len(self.upper), len(self.lower)]
        sizes += [linear, cone, sum(w for _, w in self.cones)]
        ends = np.cumsum(sizes)
        slices = [slice(int(e) - s, int(e)) for e, s in zip(ends, sizes, strict=True)]
        (
            self.equilibrium_rows,
            self.f_n_min_rows,
            self.f_n_max_rows,
            self.tau_max_rows,
            self.tau_min_rows,
            self.linear_rows,
            self.norm_rows,
            self.cone_rows,
        ) = slices
        self._bound_rows = slice(self.f_n_min_rows.start, self.f_n_max_rows.stop)
        self.rows = int(ends[-1])
        self.cone_variables = np.concatenate(
            [np.arange(starts[i], starts[i] + w) for i, w in self.cones] or [np.zeros(0, np.intp)]
        )
        offsets = np.cumsum([0] + [w for _, w in self.cones])[:-1]
        self.cone_heads = self.cone_rows.start + offsets
        self.cone_contacts = np.array([i for i, _ in self.cones], dtype=np.intp)

    @property
    def clarabel_cones(self) -> list[Any]:
        """The cones of the slacks, in the order of the rows."""
        cones = [clarabel.ZeroConeT(6)]
        if nonnegative := self.linear_rows.stop - self.equilibrium_rows.stop:
            cones.append(clarabel.NonnegativeConeT(nonnegative))
        if norm := self.norm_rows.stop - self.norm_rows.start:
            cones.append(clarabel.SecondOrderConeT(norm))
        return cones + [clarabel.SecondOrderConeT(width) for _, width in self.cones]

    def force_unit(self, problem: Problem) -> float:
        """Unit of forces and torques inside the solver: the largest load [N or N·m]."""
        return problem.load or 1.0

    def value_unit(self, problem: Problem) -> float:
        """Unit of the auxiliary variable, and so of the objective, inside the solver."""
        match self.objective:
            case Objective.MAX_TORQUE_UTILISATION:
                return self.force_unit(problem) / self._largest_limit(problem)
            case Objective.FRICTION_MARGIN:
                return 1.0
            case _:
                return self.force_unit(problem)

    def matrices(
        self, problem: Problem, utilisation: float = 1.0, slack: Array | None = None
    ) -> tuple[Array, Array]:
        """A, (rows, columns), dense, and b, (rows,), of one problem.

        Args:
            problem: A problem of this structure.
            utilisation: The parameter s of the friction-margin problem [-].
            slack: The parameters d of the friction-margin problem [N], (m,); default all one
                force unit, with the bound lambda <= 0 that makes the cones hold as they stand.
        """
        A = self._constant.copy()
        b = np.zeros(self.rows)
        facts = problem.contact_set
        unit = self.force_unit(problem)
        f = self.aux_column
        A[self.equilibrium_rows, :f] = problem.G.take(self._G_entries) * facts.scale
        b[self.equilibrium_rows] = -problem.w_ext_B
        b[self._bound_rows] = facts.bounds.take(self._bounds)
        if self._needs_torque:
            self._torque_rows(A, b, problem, facts.scale)
        if self.objective is Objective.FRICTION_MARGIN:
            b[self.linear_rows] = 0.0 if slack is None else unit
            A[self.cone_heads, self.normal_columns[self.cone_contacts]] = -utilisation
            A[self.cone_heads, f] = -1.0 if slack is None else -slack[self.cone_contacts] / unit
        return A, b / unit

    def _constant_entries(self) -> Array:
        """A, with zeros where its entries depend on the problem's numbers."""
        A = np.zeros((self.rows, self.columns))
        f = self.aux_column
        _diagonal(A, self.f_n_min_rows, self.normal_columns[self.preloaded], -1.0)
        _diagonal(A, self.f_n_max_rows, self.normal_columns[self.limited], 1.0)
        match self.objective:
            case Objective.MAX_NORMAL_FORCE:
                _diagonal(A, self.linear_rows, self.hand_normals, 1.0)
                A[self.linear_rows, f] = -1.0
            case Objective.NORM_NORMAL_FORCE:
                A[self.norm_rows.start, f] = -1.0
                normals = slice(self.norm_rows.start + 1, self.norm_rows.stop)
                _diagonal(A, normals, self.hand_normals, -1.0)
            case Objective.NORM_TORQUE:
                A[self.norm_rows.start, f] = -1.0
            case Objective.FRICTION_MARGIN:
                A[self.linear_rows, f] = 1.0
        _diagonal(A, self.cone_rows, self.cone_variables, -1.0)
        return A

    def has_loose_limits(self, problem: Problem) -> bool:
        """Whether rows of limits may need scaling: always, where they are torque limits."""
        torque = self.upper.size or self.lower.size
        return bool(torque or problem.contact_set.largest_bound > self.force_unit(problem))

    def row_scale(self, b: Array) -> Array:
        """Factors, (rows,), that keep loose limits from drowning the load in the solver's norms."""
        limits = slice(self.f_n_min_rows.start, self.tau_min_rows.stop)
        scale = np.ones(self.rows)
        scale[limits] = 1.0 / np.maximum(1.0, np.abs(b[limits]))
        return scale

    def sparsity(self, problem: Problem) -> NDArray[np.bool_]:
        """Where A may be non-zero in any problem of this structure, (rows, columns)."""
        mask = self.matrices(problem)[0] != 0.0
        mask[self.equilibrium_rows, : self.aux_column] = True
        dense = [self.tau_max_rows, self.tau_min_rows]
        if self.objective in _LINEAR_IN_TORQUE:
            dense.append(self.linear_rows)
        if self.objective is Objective.NORM_TORQUE:
            dense.append(slice(self.norm_rows.start + 1, self.norm_rows.stop))
        for rows in dense:
            mask[np.arange(rows.start, rows.stop)[:, None], self.hand_columns] = True
        return mask

    def _torque_rows(self, A: Array, b: Array, problem: Problem, scale: Array) -> None:
        joints = problem.joints
        assert joints is not None
        f = self.aux_column
        l = len(joints.names)
        J = joints.J_C.reshape(-1, l)[self.hand_flat]
        JT = np.zeros((l, f))
        JT[:, self.hand_columns] = J.T * scale[self.hand_columns]
        A[self.tau_max_rows, :f] = JT[self.upper]
        b[self.tau_max_rows] = (joints.tau_max - joints.tau_g)[self.upper]
        A[self.tau_min_rows, :f] = -JT[self.lower]
        b[self.tau_min_rows] = (joints.tau_g - joints.tau_min)[self.lower]
        if self.objective in _LINEAR_IN_TORQUE:
            A[self.linear_rows, :f] = np.vstack([JT, -JT])
            b[self.linear_rows] = np.concatenate([-joints.tau_g, joints.tau_g])
            A[self.linear_rows, f] = -self._torque_bounds(problem)
        elif self.objective is Objective.NORM_TORQUE:
            A[self.norm_rows.start + 1 : self.norm_rows.stop, :f] = -JT
            b[self.norm_rows.start + 1 : self.norm_rows.stop] = joints.tau_g

    def _torque_bounds(self, problem: Problem) -> Array:
        joints = problem.joints
        assert joints is not None
        if self.objective is Objective.MAX_TORQUE:
            return np.ones(2 * len(joints.names))
        return np.concatenate([joints.tau_max, -joints.tau_min]) / self._largest_limit(problem)

    def _largest_limit(self, problem: Problem) -> float:
        joints = problem.joints
        assert joints is not None
        return float(max(joints.tau_max.max(), -joints.tau_min.min()))

    def value(self, problem: Problem, x: Array) -> float:
        """The objective, bounded by the auxiliary variable of x [N, N·m or -]."""
        return float(x[self.aux_column]) * self.value_unit(problem)

    def wrenches(self, problem: Problem, x: Array) -> Array:
        """Contact wrenches, (m, 6), of the variables x."""
        w_OC_C = np.zeros(6 * self.m)
        unit = self.force_unit(problem)
        w_OC_C[self.flat] = x[: self.aux_column] * problem.contact_set.scale * unit
        return w_OC_C.reshape(self.m, 6)

    def multipliers(self, problem: Problem, z: Array, utilisation: float = 1.0) -> Multipliers:
        """The dual variables z by the names of their constraints; parameters as in matrices."""
        z = z * (self.value_unit(problem) / self.force_unit(problem))
        named = np.zeros(self._named_ends[-1])
        named[self._named] = z[self._named_rows]
        equilibrium, cone, f_n_min, f_n_max, tau_min, tau_max = (
            named[start:end] for start, end in pairwise(self._named_ends)
        )
        cone = cone.reshape(self.m, 6)
        cone *= problem.contact_set.reciprocal
        if self.objective is Objective.FRICTION_MARGIN:
            cone[self.cone_contacts, N] *= utilisation
        match self.objective:
            case Objective.MAX_NORMAL_FORCE:
                gradient = z[self.linear_rows]
            case Objective.MAX_TORQUE | Objective.MAX_TORQUE_UTILISATION:
                up, down = np.split(z[self.linear_rows], 2)
                gradient = up - down
            case Objective.FRICTION_MARGIN:
                gradient = np.zeros(0)
            case _:
                gradient = -z[self.norm_rows.start + 1 : self.norm_rows.stop]
        return Multipliers(equilibrium, cone, f_n_min, f_n_max, tau_min, tau_max, gradient)

    def _lay_out_multipliers(self, l: int, preloads: Array) -> None:
        """Where each row's multiplier goes in one array of all named ones."""
        ends = np.cumsum([0, 6, 6 * self.m, self.m, self.m, l, l])
        self._named_ends = [int(end) for end in ends]
        _, cone, f_n_min, f_n_max, tau_min, tau_max, _ = self._named_ends
        # A frictionless contact's cone is f_n >= 0: that is its preload row with f_n_min = 0.
        contacts = self.preloaded
        smooth = ~np.isin(contacts, self.cone_contacts) & (preloads[contacts] == 0.0)
        self._named = np.concatenate(
            [
                np.arange(6),
                np.where(smooth, cone + 6 * contacts + N, f_n_min + contacts),
                f_n_max + self.limited,
                tau_max + self.upper,
                tau_min + self.lower,
                cone + self.flat[self.cone_variables],
            ]
        )
        bounds = np.arange(self.tau_min_rows.stop)
        self._named_rows = np.concatenate([bounds, np.arange(self.rows)[self.cone_rows]])


def _diagonal(A: Array, rows: slice, columns: Array, value: float) -> None:
    A[np.arange(rows.start, rows.stop), columns] = value
