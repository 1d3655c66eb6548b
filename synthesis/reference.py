r"""An independent reference: (17) in CVXPY, in physical variables, as in the paper.

It shares no code with :mod:`synthesis.conic` and :mod:`synthesis.synthesizer`. Instead of their
grasp maps, scaled variables and eliminated torques it has moment equations about the first contact,
newtons and newton metres, and torques tied to (15) by equality. The friction margin is bisected
(its infimum, even if that is not attained). The reference is slow and meant for tests. Nothing is
normalised, so it is accurate for loads of 1 to 1000 N only.
"""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.contact import ContactModel
from fulcrum.synthesis.errors import FulcrumError, SolverError, UnboundedError
from fulcrum.synthesis.problem import Objective, Problem

# The tightest tolerance that can be reached in physical variables is used; the loosest is a
# hundredth of the deviation that the tests allow.
_TOLERANCES = (1e-10, 1e-9, 1e-8)
# Excess of friction that counts as zero, relative to the load.
_EXCESS = 1e-9
# Last interval of the bisection: 1e-7 of the smallest margins that the tests compare.
_MARGIN_TOLERANCE = 1e-9
# Positions of the variables of a contact in (f_t, f_o, f_n, m_t, m_o, m_n).
_ROWS = {
    ContactModel.FRICTIONLESS: [2],
    ContactModel.PCWF: [0, 1, 2],
    ContactModel.SFCE: [0, 1, 2, 5],
}


class ReferenceInfeasibleError(FulcrumError):
    """The reference found (17) infeasible; CVXPY returns no certificate."""


@dataclass(frozen=True, eq=False)
class ReferenceSolution:
    """An optimal solution of (17).

    Attributes:
        value: Optimal objective [N, N·m or -].
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,); empty without joints.
        variables: Number of scalar variables in the paper's formulation, without auxiliary ones.
    """

    value: float
    w_OC_C: Array
    tau: Array
    variables: int


def solve_reference(problem: Problem) -> ReferenceSolution:
    """Return the solution of (17) through CVXPY, with the status ``optimal``.

    Raises:
        ReferenceInfeasibleError: No forces satisfy the constraints.
        UnboundedError: The objective improves without limit.
        SolverError: The solver found neither.
    """
    return _Formulation(problem).solve()


class _Formulation:
    """The variables of (17) and its constraints, one method per equation of the paper."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.w = [cp.Variable(len(_ROWS[c.model]), name=c.name) for c in problem.contacts]
        joints = 0 if problem.joints is None else len(problem.joints.names)
        self.tau = cp.Variable(joints) if joints else None
        self.scalars = sum(w.size for w in self.w) + joints

    def solve(self) -> ReferenceSolution:
        if self.problem.objective is Objective.FRICTION_MARGIN:
            value = self._bisected_margin()
        else:
            value = self.run(cp.Problem(cp.Minimize(self.objective()), self.constraints()))
        tau = np.zeros(0) if self.tau is None else self.tau.value
        w_OC_C = np.zeros((len(self.w), 6))
        for row, contact, w in zip(w_OC_C, self.problem.contacts, self.w, strict=True):
            row[_ROWS[contact.model]] = w.value
        return ReferenceSolution(value, w_OC_C, tau, self.scalars)

    def constraints(self) -> list[cp.Constraint]:
        """Return all constraints of (17)."""
        return [self._imbalance() == 0, *self._limits(), *self._friction_cones()]

    def run(self, program: cp.Problem) -> float:
        """Return the optimal value of a program in these variables."""
        for tolerance in _TOLERANCES:
            tolerances = {f"tol_{name}": tolerance for name in ("feas", "gap_abs", "gap_rel")}
            with warnings.catch_warnings(), contextlib.suppress(cp.SolverError):
                warnings.filterwarnings("ignore", message="Solution may be inaccurate")
                program.solve(solver=cp.CLARABEL, **tolerances)
            match program.status:
                case cp.OPTIMAL:
                    return float(program.value)
                case cp.INFEASIBLE:
                    raise ReferenceInfeasibleError("the reference finds no feasible contact forces")
                case cp.UNBOUNDED:
                    raise UnboundedError(self.problem.objective)
        raise SolverError(str(program.status))

    def _imbalance(self) -> cp.Expression:
        """Return the left side of (12), (6,), with moments about the first contact."""
        problem = self.problem
        pivot = problem.p_OC_O[0]
        force = problem.w_ext_O[:3]
        moment = problem.w_ext_O[3:] - np.cross(pivot, force)
        for contact, w, R, p in zip(
            problem.contacts, self.w, problem.R_OC, problem.p_OC_O, strict=True
        ):
            t, o, n = R.T
            if contact.model is ContactModel.FRICTIONLESS:
                f = n * w[0]
            else:
                f = t * w[0] + o * w[1] + n * w[2]
            x, y, z = p - pivot
            force = force + f
            moment = moment + cp.hstack(
                [y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]]
            )
            if contact.model is ContactModel.SFCE:
                moment = moment + n * w[3]
        return cp.hstack([force, moment])

    def _limits(self) -> list[cp.Constraint]:
        return [*self._torques(), *self._normal_bounds()]

    def _torques(self) -> list[cp.Constraint]:
        """Return (15), with the sign of the torque that acts on the joints, and (16)."""
        joints = self.problem.joints
        if joints is None or self.tau is None:
            return []
        tau = joints.tau_g
        for J, i in zip(joints.J_C, self.problem.hands, strict=True):
            tau = tau + J[_ROWS[self.problem.contacts[i].model]].T @ self.w[i]
        constraints = [self.tau == tau]
        for k, (low, high) in enumerate(zip(joints.tau_min, joints.tau_max, strict=True)):
            constraints += [self.tau[k] <= high] if np.isfinite(high) else []
            constraints += [self.tau[k] >= low] if np.isfinite(low) else []
        return constraints

    def _normal_bounds(self) -> list[cp.Constraint]:
        """Return (7), with the preload."""
        constraints = []
        for contact, f_n in zip(self.problem.contacts, self._normals(), strict=True):
            constraints.append(f_n >= contact.f_n_min)
            if np.isfinite(contact.f_n_max):
                constraints.append(f_n <= contact.f_n_max)
        return constraints

    def _friction_cones(
        self, s: float | cp.Parameter = 1.0, excess: float | cp.Variable = 0.0
    ) -> list[cp.Constraint]:
        """Return (1) and (2) over mu, with s f_n + excess instead of f_n."""
        constraints = []
        for contact, w in zip(self.problem.contacts, self.w, strict=True):
            e = np.array([contact.e_t, contact.e_o, contact.e_n])
            if contact.model is ContactModel.PCWF:
                tangential = cp.multiply(1 / e[:2], w[:2])
            elif contact.model is ContactModel.SFCE:
                tangential = cp.multiply(1 / e, cp.hstack([w[0], w[1], w[3]]))
            else:
                continue
            constraints.append(cp.norm2(tangential) / contact.mu <= s * w[2] + excess)
        return constraints

    def objective(self) -> cp.Expression:
        """Return Phi of (17)."""
        f_n = cp.hstack(self.hand_normals())
        match self.problem.objective:
            case Objective.MAX_NORMAL_FORCE:
                return cp.max(f_n)
            case Objective.NORM_NORMAL_FORCE:
                return cp.norm2(f_n)
            case Objective.MAX_TORQUE:
                return cp.norm_inf(self.tau)
            case Objective.NORM_TORQUE:
                return cp.norm2(self.tau)
        joints = self.problem.joints
        assert joints is not None
        share = [cp.multiply(1 / limit, self.tau) for limit in (joints.tau_min, joints.tau_max)]
        return cp.max(cp.hstack(share))

    def _bisected_margin(self) -> float:
        """Bisect the utilisation s; a phase-1 program finds the least excess over s f_n [N].

        A contact that must be unloaded fixes the excess at zero, and its sign is noise: this
        reference does not solve problems with such contacts.
        """
        size = max(1.0, float(np.abs(self.problem.w_ext_O).max()))
        excess, s = cp.Variable(), cp.Parameter(nonneg=True, value=1.0)
        constraints = [self._imbalance() == 0, excess >= -size, *self._limits()]
        phase_1 = cp.Problem(cp.Minimize(excess), [*constraints, *self._friction_cones(s, excess)])
        if self.run(phase_1) > _EXCESS * size:
            raise ReferenceInfeasibleError("the reference finds no forces within the cones")
        low, high = 0.0, 1.0
        while high - low > _MARGIN_TOLERANCE:
            s.value = (low + high) / 2
            if self.run(phase_1) > 0.0:
                low = s.value
            else:
                high = s.value
        return high

    def hand_normals(self) -> list[cp.Expression]:
        """Return the normal forces of the hands [N]."""
        normals = self._normals()
        return [normals[i] for i in self.problem.hands]

    def _normals(self) -> list[cp.Expression]:
        return [w[0] if w.size == 1 else w[2] for w in self.w]
