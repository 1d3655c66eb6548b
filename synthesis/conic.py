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

All forces and torques are in units of :meth:`ConicForm.force_unit`, so that the solver's tolerances
are relative to the load. The equations are homogeneous in them: A does not change.
"""

from __future__ import annotations

from collections.abc import Hashable

import clarabel
import numpy as np
from numpy.typing import NDArray

from synthesis.contact import Array, N, Role
from synthesis.problem import Objective, Problem
from synthesis.solution import Multipliers

_LINEAR_IN_TORQUE = (Objective.MAX_TORQUE, Objective.MAX_TORQUE_UTILISATION)


def structure(problem: Problem) -> Hashable:
    """What two problems must share to be solved by the same prebuilt solver."""
    joints = problem.joints
    return (
        tuple((c.model, c.role, c.f_n_min > 0.0, np.isfinite(c.f_n_max)) for c in problem.contacts),
        joints
        and (
            len(joints.names),
            *(np.isfinite(t).tobytes() for t in (joints.tau_min, joints.tau_max)),
        ),
        problem.objective,
    )


class ConicForm:
    """Index maps of one problem structure, made once; numbers flow through them at each solve."""

    def __init__(self, problem: Problem) -> None:
        contacts, joints, objective = problem.contacts, problem.joints, problem.objective
        widths = [len(c.model.components) for c in contacts]
        starts = np.cumsum([0, *widths])
        self.m = len(contacts)
        self.objective = objective
        self.normal_columns = starts[:-1]
        self.aux_column = int(starts[-1])
        self.columns = self.aux_column + 1
        # Flat position in the (m, 6) wrenches of each variable, and its contact.
        self.flat = np.concatenate(
            [6 * i + np.array(c.model.components) for i, c in enumerate(contacts)]
        )
        hands = list(problem.hands)
        in_hand = np.concatenate(
            [np.full(w, c.role is Role.HAND) for c, w in zip(contacts, widths, strict=True)]
        )
        self.hand_columns = np.flatnonzero(in_hand)
        hand_rank = {i: rank for rank, i in enumerate(hands)}
        self.hand_flat = np.array(
            [6 * hand_rank[f // 6] + f % 6 for f in self.flat[in_hand]], dtype=np.intp
        )
        self.hand_normals = self.normal_columns[hands]

        self.preloaded = np.array(
            [
                i
                for i, c in enumerate(contacts)
                if c.f_n_min > 0.0 or widths[i] == 1 or objective is Objective.FRICTION_MARGIN
            ],
            dtype=np.intp,
        )
        self.limited = np.array(
            [i for i, c in enumerate(contacts) if np.isfinite(c.f_n_max)], dtype=np.intp
        )
        none = np.zeros(0, dtype=np.intp)
        self.upper = none if joints is None else np.flatnonzero(np.isfinite(joints.tau_max))
        self.lower = none if joints is None else np.flatnonzero(np.isfinite(joints.tau_min))
        self.cones = [(i, w) for i, w in enumerate(widths) if w > 1]
        self._lay_out_rows(0 if joints is None else len(joints.names), starts, widths)

    def _lay_out_rows(self, l: int, starts: Array, widths: list[int]) -> None:
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
        self.rows = int(ends[-1])
        self.cone_variables = np.concatenate(
            [np.arange(starts[i], starts[i] + w) for i, w in self.cones] or [np.zeros(0, np.intp)]
        )
        offsets = np.cumsum([0] + [w for _, w in self.cones])[:-1]
        self.cone_heads = self.cone_rows.start + offsets
        self.cone_contacts = np.array([i for i, _ in self.cones], dtype=np.intp)
        self.clarabel_cones = [clarabel.ZeroConeT(6)]
        if nonnegative := sum(sizes[1:6]):
            self.clarabel_cones.append(clarabel.NonnegativeConeT(nonnegative))
        if cone:
            self.clarabel_cones.append(clarabel.SecondOrderConeT(cone))
        self.clarabel_cones += [clarabel.SecondOrderConeT(w) for _, w in self.cones]

    def scale(self, problem: Problem) -> Array:
        """Contact scales of all variables, (columns - 1,)."""
        return np.concatenate([c.scale for c in problem.contacts])

    def force_unit(self, problem: Problem) -> float:
        """Unit of forces and torques inside the solver: the largest load [N or N·m]."""
        loads = [*np.abs(problem.w_ext_O), *(c.f_n_min for c in problem.contacts)]
        if problem.joints is not None and problem.objective.needs_joints:
            loads += [*np.abs(problem.joints.tau_g)]
        return float(max(loads)) or 1.0

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
        A = np.zeros((self.rows, self.columns))
        b = np.zeros(self.rows)
        scale = self.scale(problem)
        unit = self.force_unit(problem)
        f = self.aux_column
        G = problem.G.transpose(1, 0, 2).reshape(6, 6 * self.m)
        A[self.equilibrium_rows, :f] = G[:, self.flat] * scale
        b[self.equilibrium_rows] = -problem.w_ext_O
        _diagonal(A, self.f_n_min_rows, self.normal_columns[self.preloaded], -1.0)
        b[self.f_n_min_rows] = [-problem.contacts[i].f_n_min for i in self.preloaded]
        _diagonal(A, self.f_n_max_rows, self.normal_columns[self.limited], 1.0)
        b[self.f_n_max_rows] = [problem.contacts[i].f_n_max for i in self.limited]
        if problem.joints is not None:
            self._torque_rows(A, b, problem, scale)
        if self.objective is Objective.MAX_NORMAL_FORCE:
            _diagonal(A, self.linear_rows, self.hand_normals, 1.0)
            A[self.linear_rows, f] = -1.0
        elif self.objective is Objective.NORM_NORMAL_FORCE:
            A[self.norm_rows.start, f] = -1.0
            _diagonal(
                A, slice(self.norm_rows.start + 1, self.norm_rows.stop), self.hand_normals, -1.0
            )
        elif self.objective is Objective.FRICTION_MARGIN:
            A[self.linear_rows, f] = 1.0
            b[self.linear_rows] = 0.0 if slack is None else unit
        _diagonal(A, self.cone_rows, self.cone_variables, -1.0)
        if self.objective is Objective.FRICTION_MARGIN:
            A[self.cone_heads, self.normal_columns[self.cone_contacts]] = -utilisation
            A[self.cone_heads, f] = -1.0 if slack is None else -slack[self.cone_contacts] / unit
        return A, b / unit

    def row_scale(self, b: Array) -> Array:
        """Factors, (rows,), that keep loose limits from drowning the load in the solver's norms."""
        scale = np.ones(self.rows)
        limits = slice(self.f_n_min_rows.start, self.tau_min_rows.stop)
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
            A[self.norm_rows.start, f] = -1.0
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
        w_OC_C[self.flat] = x[: self.aux_column] * self.scale(problem) * self.force_unit(problem)
        return w_OC_C.reshape(self.m, 6)

    def multipliers(self, problem: Problem, z: Array, utilisation: float = 1.0) -> Multipliers:
        """The dual variables z by the names of their constraints; parameters as in matrices."""
        z = z * (self.value_unit(problem) / self.force_unit(problem))
        l = 0 if problem.joints is None else len(problem.joints.names)
        f_n_min, f_n_max = np.zeros(self.m), np.zeros(self.m)
        tau_min, tau_max = np.zeros(l), np.zeros(l)
        f_n_min[self.preloaded] = z[self.f_n_min_rows]
        f_n_max[self.limited] = z[self.f_n_max_rows]
        tau_max[self.upper] = z[self.tau_max_rows]
        tau_min[self.lower] = z[self.tau_min_rows]
        flat = np.zeros(6 * self.m)
        scaled = self.cone_variables
        flat[self.flat[scaled]] = z[self.cone_rows] / self.scale(problem)[scaled]
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
        cone = flat.reshape(self.m, 6)
        cone[self.cone_contacts, N] *= utilisation
        # A frictionless contact's cone is f_n >= 0: that is its preload row with f_n_min = 0.
        for i in self.preloaded:
            if (
                len(problem.contacts[i].model.components) == 1
                and problem.contacts[i].f_n_min == 0.0
            ):
                cone[i, N], f_n_min[i] = f_n_min[i], 0.0
        return Multipliers(
            equilibrium=z[self.equilibrium_rows],
            cone=cone,
            f_n_min=f_n_min,
            f_n_max=f_n_max,
            tau_min=tau_min,
            tau_max=tau_max,
            gradient=gradient,
        )


def _diagonal(A: Array, rows: slice, columns: Array, value: float) -> None:
    A[np.arange(rows.start, rows.stop), columns] = value
