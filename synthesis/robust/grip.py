r"""One grip for many worlds: the robust counterpart of (17).

The worlds are problems of one structure. They differ in what is unknown when the grip is chosen:
external wrench (mass, centre of mass, push), friction and contact places. The normal forces of the
hands :math:`F_n` are chosen once; all other forces f_v may differ from world to world v:

.. math::

    \text{minimise}\quad   & \Phi(F_n) \\
    \text{subject to}\quad & F_{n,min} \le F_n \le F_{n,max} \\
                           & (F_n, f_v) \text{ satisfies (12), (15), (16), (5), (6), and (7) at the
                             environment, for every world } v

In :math:`(F_n, f_v, w_v)` the constraints are jointly convex: for a fixed :math:`F_n` the external
wrenches that a set of cones can bear are a convex set, which grows with the friction coefficients.
So the given worlds represent all worlds whose wrench is a convex combination of theirs and whose
friction is no smaller. This does not hold for contact places, which multiply forces.

It is one second-order cone program: the rows of :mod:`synthesis.conic` for each world, with common
columns for :math:`F_n` and the objective's bound. Rows on those columns alone appear once.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import clarabel
import numpy as np
import scipy.sparse as sp

from fulcrum.synthesis import InvalidInputError, Objective, Problem, SolverError
from fulcrum.synthesis.arrays import Array, Indices, N
from fulcrum.synthesis.conic import ConicForm, structure
from fulcrum.synthesis.robust.certificate import (
    RobustCertificate,
    RobustInfeasibleError,
    robust_certificate,
)
from fulcrum.synthesis.solution import violation
from fulcrum.synthesis.solver import SOLVED, attempts

_OBJECTIVES = (Objective.MAX_NORMAL_FORCE, Objective.NORM_NORMAL_FORCE)
# Largest residual over the load [-]; the solver's 1e-9 is relative to its largest numbers.
_WORST_RESIDUAL = 1e-6
# A proof of infeasibility must hold for forces up to this many times the load [-].
_FARTHEST = 1e4


@dataclass(frozen=True, eq=False)
class RobustGrip:
    """Normal forces of the hands that serve every world, with all wrenches and torques in each.

    Attributes:
        problems: The v worlds.
        f_n: Normal forces of the n hands [N], (n,).
        value: Objective [N].
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
        """Return the largest violation in each world over the largest load [-], (v,)."""
        unit = max(problem.load for problem in self.problems) or 1.0
        hands = self.problems[0].contact_set.hand_rows
        common = np.abs(self.w_OC_C[:, hands, N] - self.f_n).max(axis=1, initial=0.0)
        worlds = zip(self.problems, self.w_OC_C, self.tau, strict=True)
        return np.maximum([violation(*world) for world in worlds], common) / unit


def robust_grip(problems: Sequence[Problem]) -> RobustGrip:
    """Return the least normal forces of the hands that serve all worlds.

    Args:
        problems: The worlds, with the objective ``max-normal-force`` or ``norm-normal-force``.
            Joints and contacts are the same, except for friction; wrenches, places, Jacobians and
            torque limits may differ.

    Raises:
        InvalidInputError: The worlds differ in structure.
        RobustInfeasibleError: No normal forces serve all worlds; carries the certificate.
        SolverError: The solver found neither forces that serve all worlds nor a proof.
    """
    problems = tuple(problems)
    _check(problems)
    program = _Program(problems)
    started = time.perf_counter()
    status = ""
    for status, result in program.attempts():
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
        valid = f"{' or '.join(_OBJECTIVES)}, which depend on the normal forces alone"
        raise InvalidInputError("objective", first.objective, valid)
    for v, problem in enumerate(problems):
        if _fixed(problem) != _fixed(first):
            given = "another structure than problems[0]"
            valid = "the same objective, names, models, bounds of the hands and joints"
            raise InvalidInputError(f"problems[{v}]", given, valid)


def _fixed(problem: Problem) -> object:
    """Return everything that must be the same in all worlds."""
    names = tuple(c.name for c in problem.contacts)
    hands = [problem.contacts[i] for i in problem.hands]
    bounds = [(hand.f_n_min, hand.f_n_max) for hand in hands]
    joints = None if problem.joints is None else problem.joints.names
    return structure(problem), names, bounds, joints


class _Program:
    """The conic forms of all worlds as one program.

    Attributes:
        unit: Unit of forces and torques inside the solver [N or N·m].
    """

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        self._problems = problems
        self._form = form = ConicForm(problems[0])
        self.unit = max(problem.unit for problem in problems)
        blocks = [form.matrices(problem) for problem in problems]
        A = np.array([A for A, _ in blocks])
        pairs = zip(blocks, problems, strict=True)
        b = np.array([b * (problem.unit / self.unit) for (_, b), problem in pairs])
        self._scale = np.array([form.row_scale(b_v) for b_v in b])
        self._columns = self._lay_out_columns(len(problems))
        self._rows, self._cones = self._lay_out_rows(len(problems))
        there = self._rows >= 0
        v, r, c = np.nonzero(A * there[:, :, None])
        entries = (A * self._scale[:, :, None])[v, r, c]
        shape = (int(self._rows.max()) + 1, int(self._columns.max()) + 1)
        self._A = sp.csc_matrix((entries, (self._rows[v, r], self._columns[v, c])), shape=shape)
        self._b = np.zeros(shape[0])
        self._b[self._rows[there]] = (b * self._scale)[there]

    def _lay_out_columns(self, worlds: int) -> Indices:
        """Return the column of each variable of each world, common ones first, (v, columns)."""
        form = self._form
        common = np.append(form.hand_normals, form.aux_column)
        own = np.setdiff1d(np.arange(form.columns), common)
        columns = np.zeros((worlds, form.columns), dtype=np.intp)
        columns[:, common] = np.arange(len(common))
        columns[:, own] = len(common) + np.arange(worlds * len(own)).reshape(worlds, -1)
        return columns

    def _lay_out_rows(self, worlds: int) -> tuple[Indices, list[Any]]:
        """Return each constraint's row, (v, rows), -1 if only world 0 has it; and the cones."""
        form, every = self._form, np.arange(self._form.rows)
        hands = self._problems[0].hands
        preloads = every[form.f_n_min_rows][np.isin(form.preloaded, hands)]
        bounds = every[form.f_n_max_rows][np.isin(form.limited, hands)]
        once = np.concatenate([preloads, bounds, every[form.linear_rows]])
        each = np.setdiff1d(every[form.f_n_min_rows.start : form.linear_rows.stop], once)
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

    def attempts(self) -> Iterator[tuple[str, clarabel.DefaultSolution]]:
        """Yield status and result of the solver with one setting after the other."""
        q = np.zeros(self._A.shape[1])
        q[len(self._form.hand_normals)] = 1.0
        return attempts(q, self._A, self._b, self._cones)

    def grip(self, result: clarabel.DefaultSolution, solve_s: float) -> RobustGrip:
        """Return the grip of a solver's result."""
        problems, form = self._problems, self._form
        # Each world's form scales with its own load.
        x = np.array(result.x)[self._columns] * self.unit
        pairs = zip(problems, x, strict=True)
        w_OC_C = np.array([form.wrenches(p, x_v / p.unit) for p, x_v in pairs])
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
        """Return the proof that no grip serves all worlds."""
        z = np.where(self._rows >= 0, np.array(result.z)[self._rows], 0.0) * self._scale
        rays = [self._form.multipliers(p, z_v) for p, z_v in zip(self._problems, z, strict=True)]
        return robust_certificate(self._problems, rays)
