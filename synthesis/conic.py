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

For the friction margin the cones are :math:`\|f_t\| \le s f_n + \lambda d_i` with parameters
:math:`s, d_i`, and all contacts count as preloaded, because at :math:`s = 0` the cones leave
:math:`f_n` free; see :mod:`synthesis.friction_margin`. Without the torque limits the form is a
relaxation, with two thirds fewer entries for two arms of seven joints; see
:mod:`synthesis.synthesizer`.

All forces and torques are in units of :attr:`Problem.unit`, so that the solver's tolerances are
relative to the load. The equations are homogeneous in them: A does not change.
"""

from __future__ import annotations

from collections.abc import Hashable
from itertools import pairwise
from typing import Any

import clarabel
import numpy as np

from fulcrum.synthesis.arrays import Array, Indices, Mask, N
from fulcrum.synthesis.problem import Objective, Problem
from fulcrum.synthesis.solution import Multipliers

_LINEAR_IN_TORQUE = (Objective.MAX_TORQUE, Objective.MAX_TORQUE_UTILISATION)


def structure(problem: Problem, torque_limits: bool = True) -> Hashable:
    """Return a key that is equal for two problems which the same prebuilt solver can solve."""
    joints = problem.joints
    limits: Hashable = None
    if joints is not None and torque_limits:
        limits = np.isfinite(joints.tau_min).tobytes(), np.isfinite(joints.tau_max).tobytes()
    names = () if joints is None else joints.names
    return problem.contact_set.structure, problem.objective, len(names), limits


class ConicForm:
    """Index maps of one problem structure, made once and used for the numbers of each solve."""

    def __init__(self, problem: Problem, torque_limits: bool = True) -> None:
        """Lay out rows and columns.

        Args:
            problem: Any problem of the structure.
            torque_limits: Whether (16) has rows; without them the form is a relaxation.
        """
        joints, facts = problem.joints, problem.contact_set
        self.m, self.objective = len(problem.contacts), problem.objective
        self.normal_columns, self.aux_column = facts.starts[:-1], int(facts.starts[-1])
        self.columns = self.aux_column + 1
        # Flat position in the (m, 6) wrenches of each variable.
        self.flat = facts.flat
        contact, component = np.divmod(self.flat, 6)
        hands = np.array(facts.hands, dtype=np.intp)
        self.hand_normals = self.normal_columns[hands]
        self.hand_columns = np.flatnonzero(np.isin(contact, hands))
        # Flat position in the (n, 6) wrenches of the hands.
        rank = np.searchsorted(hands, contact[self.hand_columns])
        self.hand_flat = 6 * rank + component[self.hand_columns]
        # Flat position in the (m, 6, 6) grasp maps of each entry of the equilibrium rows.
        self._G_entries = 36 * contact + 6 * np.arange(6)[:, None] + component

        widths = np.array(facts.widths)
        margin = self.objective is Objective.FRICTION_MARGIN
        self.preloaded = np.flatnonzero((facts.f_n_min > 0.0) | (widths == 1) | margin)
        self.limited = np.flatnonzero(np.isfinite(facts.f_n_max))
        self._bounds = np.concatenate([self.preloaded, self.m + self.limited])
        bounds = (joints.tau_max, joints.tau_min) if joints and torque_limits else ((), ())
        self.upper, self.lower = (np.flatnonzero(np.isfinite(bound)) for bound in bounds)
        self.cones = [(i, w) for i, w in enumerate(facts.widths) if w > 1]
        self.cone_contacts = np.flatnonzero(widths > 1)
        self.cone_variables = np.flatnonzero(widths[contact] > 1)
        self._needs_torque = bool(self.upper.size or self.lower.size or self.objective.needs_joints)
        l = 0 if joints is None else len(joints.names)
        self._lay_out_rows(l)
        self.cone_heads = self.cone_rows.start + np.flatnonzero(component[self.cone_variables] == N)
        self._lay_out_multipliers(l, facts.f_n_min)
        self._constant = self._constant_entries()

    def _lay_out_rows(self, l: int) -> None:
        n = len(self.hand_normals)
        linear = {
            Objective.MAX_NORMAL_FORCE: n,
            Objective.MAX_TORQUE: 2 * l,
            Objective.MAX_TORQUE_UTILISATION: 2 * l,
            Objective.FRICTION_MARGIN: 1,
        }.get(self.objective, 0)
        norm = {Objective.NORM_NORMAL_FORCE: 1 + n, Objective.NORM_TORQUE: 1 + l}
        sizes = [len(each) for each in (self.preloaded, self.limited, self.upper, self.lower)]
        sizes += [linear, norm.get(self.objective, 0), len(self.cone_variables)]
        ends = np.cumsum([0, 6, *sizes]).tolist()
        (
            self.equilibrium_rows,
            self.f_n_min_rows,
            self.f_n_max_rows,
            self.tau_max_rows,
            self.tau_min_rows,
            self.linear_rows,
            self.norm_rows,
            self.cone_rows,
        ) = (slice(*pair) for pair in pairwise(ends))
        # The rows of the norm after its head.
        self._normed = slice(self.norm_rows.start + 1, self.norm_rows.stop)
        self.bound_rows = slice(self.f_n_min_rows.start, self.tau_min_rows.stop)
        self.rows = ends[-1]

    @property
    def clarabel_cones(self) -> list[Any]:
        """Return the cones of the slacks, in the order of the rows."""
        cones = [clarabel.ZeroConeT(6)]
        if nonnegative := self.linear_rows.stop - self.equilibrium_rows.stop:
            cones.append(clarabel.NonnegativeConeT(nonnegative))
        if norm := self.norm_rows.stop - self.norm_rows.start:
            cones.append(clarabel.SecondOrderConeT(norm))
        return cones + [clarabel.SecondOrderConeT(width) for _, width in self.cones]

    def value_unit(self, problem: Problem) -> float:
        """Return the unit of the objective inside the solver [N, N·m or -]."""
        if self.objective is Objective.FRICTION_MARGIN:
            return 1.0
        if self.objective is Objective.MAX_TORQUE_UTILISATION:
            assert problem.joints is not None
            return problem.unit / problem.joints.largest_limit
        return problem.unit

    def matrices(
        self, problem: Problem, utilisation: float = 1.0, slack: Array | None = None
    ) -> tuple[Array, Array]:
        """Return A, (rows, columns), dense, and b, (rows,), of one problem.

        Args:
            problem: Problem of this structure.
            utilisation: Parameter s of the friction-margin problem [-].
            slack: Parameters d of the friction-margin problem [N], (m,). By default all are one
                unit of force, with the bound lambda <= 0, and the cones hold as they are.
        """
        A = self._constant.copy()
        b = np.zeros(self.rows)
        facts = problem.contact_set
        unit = problem.unit
        f = self.aux_column
        A[self.equilibrium_rows, :f] = problem.G.take(self._G_entries) * facts.scale
        b[self.equilibrium_rows] = -problem.w_ext_B
        b[self.f_n_min_rows.start : self.f_n_max_rows.stop] = facts.bounds.take(self._bounds)
        if self._needs_torque:
            self._torque_rows(A, b, problem, facts.scale)
        if self.objective is Objective.FRICTION_MARGIN:
            b[self.linear_rows] = 0.0 if slack is None else unit
            A[self.cone_heads, self.normal_columns[self.cone_contacts]] = -utilisation
            A[self.cone_heads, f] = -1.0 if slack is None else -slack[self.cone_contacts] / unit
        return A, b / unit

    def _constant_entries(self) -> Array:
        """Return A with zeros where its entries depend on the problem's numbers."""
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
                _diagonal(A, self._normed, self.hand_normals, -1.0)
            case Objective.NORM_TORQUE:
                A[self.norm_rows.start, f] = -1.0
            case Objective.FRICTION_MARGIN:
                A[self.linear_rows, f] = 1.0
        _diagonal(A, self.cone_rows, self.cone_variables, -1.0)
        return A

    def has_loose_limits(self, problem: Problem) -> bool:
        """Return whether rows of limits may need scaling; torque limits always may."""
        torque = self.upper.size or self.lower.size
        return bool(torque or problem.contact_set.largest_bound > problem.unit)

    def row_scale(self, b: Array) -> Array:
        """Return row factors, (rows,), so that loose limits do not dominate the solver's norms."""
        scale = np.ones(self.rows)
        scale[self.bound_rows] = 1.0 / np.maximum(1.0, np.abs(b[self.bound_rows]))
        return scale

    def sparsity(self, problem: Problem) -> Mask:
        """Return where A may be non-zero in any problem of this structure, (rows, columns)."""
        mask = self.matrices(problem)[0] != 0.0
        mask[self.equilibrium_rows, : self.aux_column] = True
        dense = [self.tau_max_rows, self.tau_min_rows]
        if self.objective in _LINEAR_IN_TORQUE:
            dense.append(self.linear_rows)
        if self.objective is Objective.NORM_TORQUE:
            dense.append(self._normed)
        for rows in dense:
            mask[rows, self.hand_columns] = True
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
            bounds = np.ones(2 * l)
            if self.objective is Objective.MAX_TORQUE_UTILISATION:
                bounds = np.concatenate([joints.tau_max, -joints.tau_min]) / joints.largest_limit
            A[self.linear_rows, f] = -bounds
        elif self.objective is Objective.NORM_TORQUE:
            A[self._normed, :f] = -JT
            b[self._normed] = joints.tau_g

    def value(self, problem: Problem, x: Array) -> float:
        """Return the objective at the variables x [N, N·m or -]."""
        return float(x[self.aux_column]) * self.value_unit(problem)

    def wrenches(self, problem: Problem, x: Array) -> Array:
        """Return the contact wrenches, (m, 6), at the variables x."""
        w_OC_C = np.zeros(6 * self.m)
        w_OC_C[self.flat] = x[: self.aux_column] * problem.contact_set.scale * problem.unit
        return w_OC_C.reshape(self.m, 6)

    def multipliers(self, problem: Problem, z: Array, utilisation: float = 1.0) -> Multipliers:
        """Return the dual variables z by constraint; `utilisation` as in :meth:`matrices`."""
        z = z * (self.value_unit(problem) / problem.unit)
        named = np.zeros(self._named_ends[-1])
        named[self._named] = z[self._named_rows]
        equilibrium, cone, f_n_min, f_n_max, tau_min, tau_max = (
            named[start:end] for start, end in pairwise(self._named_ends)
        )
        cone = cone.reshape(self.m, 6)
        cone *= problem.contact_set.reciprocal
        match self.objective:
            case Objective.FRICTION_MARGIN:
                cone[self.cone_contacts, N] *= utilisation
                gradient = np.zeros(0)
            case Objective.MAX_NORMAL_FORCE:
                gradient = z[self.linear_rows]
            case Objective.MAX_TORQUE | Objective.MAX_TORQUE_UTILISATION:
                up, down = np.split(z[self.linear_rows], 2)
                gradient = up - down
            case _:
                gradient = -z[self._normed]
        return Multipliers(equilibrium, cone, f_n_min, f_n_max, tau_min, tau_max, gradient)

    def _lay_out_multipliers(self, l: int, preloads: Array) -> None:
        """Set where each row's multiplier goes in one array of all named multipliers."""
        self._named_ends = np.cumsum([0, 6, 6 * self.m, self.m, self.m, l, l]).tolist()
        _, cone, f_n_min, f_n_max, tau_min, tau_max, _ = self._named_ends
        # The cone of a frictionless contact is f_n >= 0: its preload row with f_n_min = 0.
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
        self._named_rows = np.r_[: self.tau_min_rows.stop, self.cone_rows]


def _diagonal(A: Array, rows: slice, columns: Indices, value: float) -> None:
    A[np.arange(rows.start, rows.stop), columns] = value
