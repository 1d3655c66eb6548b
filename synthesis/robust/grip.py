r"""One grip for many worlds: the robust counterpart of (17).

The worlds are problems of one structure. They differ in what is not known when the hands are told
how hard to press: external wrench (mass, centre of mass, push), friction, contact places. The
normal forces of the hands :math:`F_n` are chosen once; all other forces f_v settle in each world v,
as statics does:

.. math::

    \text{minimise}\quad   & \Phi(F_n) \\
    \text{subject to}\quad & F_{n,min} \le F_n \le F_{n,max} \\
                           & (F_n, f_v) \text{ satisfies (12), (15), (16), (5), (6), and (7) at the
                             environment, for every world } v

In :math:`(F_n, f_v, w_v)` the constraints are jointly convex: for a fixed :math:`F_n` the external
wrenches that a set of cones can bear are a convex set, and it grows with the friction
coefficients. So the worlds given stand for all those whose wrench is a convex combination of
theirs, and whose friction is no smaller. That is not so for contact places, which multiply forces.

This is one second-order cone program: the rows of :mod:`synthesis.conic` for each world, with the
columns of :math:`F_n` and of the objective's bound in common, and the rows on those alone once.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import clarabel
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fulcrum.synthesis import InvalidInputError, Objective, Problem, SolverError
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.conic import ConicForm, structure
from fulcrum.synthesis.robust.certificate import (
    RobustCertificate,
    RobustInfeasibleError,
    robust_certificate,
)
from fulcrum.synthesis.solver import SOLVED, fallback_settings, solver_settings

_OBJECTIVES = (Objective.MAX_NORMAL_FORCE, Objective.NORM_NORMAL_FORCE)
# The solver's 1e-9 is relative to its largest numbers; what is left over in newtons may exceed it.
_WORST_RESIDUAL = 1e-6
# A proof of infeasibility must hold for forces up to this many times the load [-].
_FARTHEST = 1e4


@dataclass(frozen=True, eq=False)
class RobustGrip:
    """Normal forces of the hands that serve every world, and what goes with them in each.

    Attributes:
        problems: The v worlds.
        f_n: Normal forces of the n hands [N], (n,).
        value: The objective [N].
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (v, m, 6).
        tau: Joint torques [N·m or N], (v, l); l = 0 without joints.
        iterations: Interior-point iterations.
        solve_s: Time inside the solver [s].
    """

    problems: tuple[Problem, ...]
    f_n: Array
    value: float
    w_OC_C: Array
    tau: Array
    iterations: int
    solve_s: float

    @cached_property
    def residuals(self) -> Array:
        """Largest violation of any constraint of each world over the largest load [-], (v,)."""
        pairs = zip(self.problems, self.w_OC_C, self.tau, strict=True)
        unit = max(problem.load for problem in self.problems) or 1.0
        return np.array([_violation(*pair, self.f_n) / unit for pair in pairs])


def robust_grip(problems: Sequence[Problem]) -> RobustGrip:
    """The least normal forces of the hands that serve all worlds.

    Args:
        problems: The worlds: the same contacts but for friction, and the same joints; wrench,
            places, Jacobians and torque limits are each one's own. The objective is
            ``max-normal-force`` or ``norm-normal-force``.

    Raises:
        InvalidInputError: The worlds do not belong together.
        RobustInfeasibleError: No normal forces serve all; carries the certificate.
        SolverError: The solver gave neither forces that serve all worlds nor a proof.
    """
    problems = tuple(problems)
    _check(problems)
    program = _Program(problems)
    started = time.perf_counter()
    status = ""
    for settings in (solver_settings(), *fallback_settings()):
        result = program.solve(settings)
        status = str(result.status)
        if status in SOLVED:
            grip = program.grip(result, time.perf_counter() - started)
            if grip.residuals.max() <= _WORST_RESIDUAL:
                return grip
        elif status == "PrimalInfeasible":
            proof = program.certificate(result)
            if proof.proves(_FARTHEST * program.unit):
                raise RobustInfeasibleError(proof)
    raise SolverError(status)


def _check(problems: tuple[Problem, ...]) -> None:
    if not problems:
        raise InvalidInputError("problems", "no world", "at least one")
    first = problems[0]
    if first.objective not in _OBJECTIVES:
        valid = f"{' or '.join(_OBJECTIVES)}, which the normal forces alone determine"
        raise InvalidInputError("objective", first.objective, valid)
    kind, fixed = structure(first), _fixed(first)
    for v, problem in enumerate(problems):
        if structure(problem) != kind or _fixed(problem) != fixed:
            raise InvalidInputError(
                f"problems[{v}]",
                "another structure than problems[0]",
                "the same objective, names, models, bounds of the hands and joints",
            )


def _fixed(problem: Problem) -> object:
    """What is the same in all worlds, beyond the structure."""
    names = tuple(c.name for c in problem.contacts)
    bounds = tuple(
        (problem.contacts[i].f_n_min, problem.contacts[i].f_n_max) for i in problem.hands
    )
    return names, bounds, None if problem.joints is None else problem.joints.names


class _Program:
    """The conic forms of all worlds, side by side, as one for Clarabel.

    Attributes:
        unit: Of forces and torques inside the solver [N or N·m].
    """

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        self._problems = problems
        self._form = form = ConicForm(problems[0])
        worlds = len(problems)
        self.unit = max(form.force_unit(problem) for problem in problems)
        blocks = [form.matrices(problem) for problem in problems]
        A = np.array([A for A, _ in blocks])
        units = [form.force_unit(problem) / self.unit for problem in problems]
        b = np.array([b * unit for (_, b), unit in zip(blocks, units, strict=True)])
        self._scale = np.array([form.row_scale(b_v) for b_v in b])
        self._columns = self._lay_out_columns(worlds)
        self._rows, self._cones = self._lay_out_rows(worlds)
        # Entries of rows that are not repeated have the row -1.
        v, r, c = np.nonzero(A)
        kept = self._rows[v, r] >= 0
        v, r, c = v[kept], r[kept], c[kept]
        entries = (A * self._scale[:, :, None])[v, r, c]
        shape = (int(self._rows.max()) + 1, int(self._columns.max()) + 1)
        self._A = sp.csc_matrix((entries, (self._rows[v, r], self._columns[v, c])), shape=shape)
        self._b = np.zeros(shape[0])
        there = self._rows >= 0
        self._b[self._rows[there]] = (b * self._scale)[there]

    def _lay_out_columns(self, worlds: int) -> NDArray[np.intp]:
        """Column of each variable of each world: those in common first, (v, columns)."""
        form = self._form
        common = np.append(form.hand_normals, form.aux_column)
        own = np.setdiff1d(np.arange(form.columns), common)
        columns = np.zeros((worlds, form.columns), dtype=np.intp)
        columns[:, common] = np.arange(len(common))
        columns[:, own] = len(common) + np.arange(worlds * len(own)).reshape(worlds, -1)
        return columns

    def _lay_out_rows(self, worlds: int) -> tuple[NDArray[np.intp], list]:
        """Row of each constraint of each world, -1 where it is the first's, and the cones."""
        form, every = self._form, np.arange(self._form.rows)
        hands = self._problems[0].hands
        linear = every[form.f_n_min_rows.start : form.linear_rows.stop]
        once = np.concatenate(
            [
                every[form.f_n_min_rows][np.isin(form.preloaded, hands)],
                every[form.f_n_max_rows][np.isin(form.limited, hands)],
                every[form.linear_rows],
            ]
        )
        each = np.setdiff1d(linear, once)
        rows = np.full((worlds, form.rows), -1, dtype=np.intp)
        norm, cone = every[form.norm_rows], every[form.cone_rows]
        sizes = [6 * worlds, len(each) * worlds, len(once), len(norm), len(cone) * worlds]
        places = [np.arange(*ends) for ends in pairwise(np.cumsum([0, *sizes]).tolist())]
        rows[:, form.equilibrium_rows] = places[0].reshape(worlds, -1)
        rows[:, each] = places[1].reshape(worlds, -1)
        rows[0, once], rows[0, norm] = places[2], places[3]
        rows[:, cone] = places[4].reshape(worlds, -1)
        cones = [clarabel.ZeroConeT(sizes[0])]
        if nonnegative := sizes[1] + sizes[2]:
            cones.append(clarabel.NonnegativeConeT(nonnegative))
        if len(norm):
            cones.append(clarabel.SecondOrderConeT(len(norm)))
        cones += [clarabel.SecondOrderConeT(width) for _, width in form.cones] * worlds
        return rows, cones

    def solve(self, settings: clarabel.DefaultSettings) -> clarabel.DefaultSolution:
        """One solve."""
        columns = self._A.shape[1]
        q = np.zeros(columns)
        q[len(self._form.hand_normals)] = 1.0
        P = sp.csc_matrix((columns, columns))
        return clarabel.DefaultSolver(P, q, self._A, self._b, self._cones, settings).solve()

    def grip(self, result: clarabel.DefaultSolution, solve_s: float) -> RobustGrip:
        """The solution by its names."""
        problems, form = self._problems, self._form
        # Each world's form scales with its own load.
        x = np.array(result.x)[self._columns] * self.unit
        w_OC_C = np.array(
            [form.wrenches(p, x_v / form.force_unit(p)) for p, x_v in zip(problems, x, strict=True)]
        )
        return RobustGrip(
            problems=problems,
            f_n=w_OC_C[0, list(problems[0].hands), N],
            value=float(x[0, form.aux_column]),
            w_OC_C=w_OC_C,
            tau=np.array([p.torque(w) for p, w in zip(problems, w_OC_C, strict=True)]),
            iterations=result.iterations,
            solve_s=solve_s,
        )

    def certificate(self, result: clarabel.DefaultSolution) -> RobustCertificate:
        """The proof that no grip serves all worlds."""
        z = np.where(self._rows >= 0, np.array(result.z)[self._rows], 0.0) * self._scale
        rays = [self._form.multipliers(p, z_v) for p, z_v in zip(self._problems, z, strict=True)]
        return robust_certificate(self._problems, rays)


def _violation(problem: Problem, w_OC_C: Array, tau: Array, f_n: Array) -> float:
    """Largest violation of (5), (6), (7), (12), (16) or of the common f_n [N, N·m]."""
    facts, normals = problem.contact_set, w_OC_C[:, N]
    balance = np.einsum("mkj,mj->k", problem.G, w_OC_C) + problem.w_ext_B
    cones = np.linalg.norm(w_OC_C * facts.friction, axis=1) - normals
    violations = [
        np.abs(balance),
        cones,
        facts.f_n_min - normals,
        normals - facts.f_n_max,
        np.abs(normals[facts.hand_rows] - f_n),
        np.abs(w_OC_C[facts.reciprocal == 0.0]),
    ]
    if problem.joints is not None:
        violations += [tau - problem.joints.tau_max, problem.joints.tau_min - tau]
    return max(float(values.max(initial=0.0)) for values in violations)
