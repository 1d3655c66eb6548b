"""Solutions and infeasibility certificates that compute their own proof, without the solver.

With multipliers nu (equilibrium), y_i (cones), alpha and beta (normal force bounds), gamma- and
gamma+ (torque limits), the Lagrangian of (17) is

    Phi + nu (G F + w) - sum y_i f_i + alpha (F_min - F_n) + beta (F_n - F_max)
        + gamma+ (tau - tau_max) + gamma- (tau_min - tau)

Its gradient in each transmitted component vanishes at a solution (stationarity), and its value
there, the dual value, equals Phi (no gap). With Phi = 0 and a positive value the same multipliers
prove that no forces satisfy the constraints (Farkas): each term is at most zero for a feasible F.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from fulcrum.synthesis.arrays import M_N, Array, N, O, T
from fulcrum.synthesis.contact import ContactModel, utilisation
from fulcrum.synthesis.errors import FulcrumError
from fulcrum.synthesis.markdown import number
from fulcrum.synthesis.problem import Objective, Problem
from fulcrum.synthesis.render import Marked, Page, page, table, to_markdown

# Number of joints or constraints in a table.
_NAMED = 6
# A utilisation of 0 (normal forces alone balance the object) would leave no cone.
_SMALLEST_UTILISATION = 1e-9
_AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
_UNITS = {"normal-force": "N", "torque": "N·m"}


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Lagrange multipliers by the names of their constraints.

    Attributes:
        equilibrium: nu, (6,): derivative of the optimal objective by ``w_ext_B``, which is
            ``w_ext_O`` unless the object frame is far from the contacts.
        cone: y, (m, 6): an element of the dual friction cone, in transmitted components.
        f_n_min: alpha >= 0, (m,).
        f_n_max: beta >= 0, (m,).
        tau_min: gamma- >= 0, (l,).
        tau_max: gamma+ >= 0, (l,).
        gradient: Subgradient of the objective in F_n, (n,), or in tau, (l,); empty for the
            friction margin and for a certificate.
    """

    equilibrium: Array
    cone: Array
    f_n_min: Array
    f_n_max: Array
    tau_min: Array
    tau_max: Array
    gradient: Array

    def over(self, divisor: float) -> Multipliers:
        """Return all multipliers divided by a number."""
        return Multipliers(*(getattr(self, f.name) / divisor for f in fields(self)))

    def stationarity(self, problem: Problem) -> Array:
        """Return the Lagrangian's gradient in the transmitted wrench components, (m, 6)."""
        residual = np.einsum("mkj,k->mj", problem.G, self.equilibrium) - self.cone
        residual[:, N] += self.f_n_max - self.f_n_min
        hands = list(problem.hands)
        torque = self.tau_max - self.tau_min
        if problem.objective.needs_joints and self.gradient.size:
            torque = torque + self.gradient
        elif self.gradient.size:
            residual[hands, N] += self.gradient
        if problem.joints is not None:
            residual[hands] += problem.joints.J_C @ torque
        return residual * problem.contact_set.transmitted

    def value(self, problem: Problem) -> float:
        """Return the dual objective: the Lagrangian's value where it is stationary."""
        value = self.equilibrium @ problem.w_ext_B
        for contact, alpha, beta in zip(problem.contacts, self.f_n_min, self.f_n_max, strict=True):
            value += alpha * contact.f_n_min - (beta * contact.f_n_max if beta else 0.0)
        joints = problem.joints
        if joints is not None:
            upper, lower = self.tau_max != 0.0, self.tau_min != 0.0
            value += self.tau_max[upper] @ (joints.tau_g - joints.tau_max)[upper]
            value += self.tau_min[lower] @ (joints.tau_min - joints.tau_g)[lower]
            if problem.objective.needs_joints and self.gradient.size:
                value += self.gradient @ joints.tau_g
        return float(value)

    def cone_violation(self, problem: Problem) -> float:
        """Return the largest distance of a multiplier from its dual cone; 0 or less inside."""
        nonnegative = (self.f_n_min, self.f_n_max, self.tau_min, self.tau_max)
        worst = max((-float(v.min()) for v in nonnegative if v.size), default=0.0)
        for contact, y in zip(problem.contacts, self.cone, strict=True):
            scaled = y[list(contact.model.components)] * contact.scale
            worst = max(worst, float(np.linalg.norm(scaled[1:]) - scaled[0]))
        return worst

    def weights(self, problem: Problem) -> dict[str, float]:
        """Return the size of each constraint's multiplier, in its dual unit, by name."""
        weights = {
            f"equilibrium {axis}": abs(float(value))
            for axis, value in zip(_AXES, self.equilibrium, strict=True)
        }
        for i, contact in enumerate(problem.contacts):
            weights[f"friction cone of {contact.name}"] = float(np.linalg.norm(self.cone[i]))
            weights[f"f_n_min of {contact.name}"] = float(self.f_n_min[i])
            weights[f"f_n_max of {contact.name}"] = float(self.f_n_max[i])
        for k, name in enumerate(problem.joints.names if problem.joints else ()):
            weights[f"tau_min of {name}"] = float(self.tau_min[k])
            weights[f"tau_max of {name}"] = float(self.tau_max[k])
        return weights


def heaviest(weights: dict[str, float], count: int) -> list[str]:
    """Return the names of the largest positive weights, heaviest first, at most `count`."""
    return sorted((n for n in weights if weights[n] > 0.0), key=lambda n: -weights[n])[:count]


@dataclass(frozen=True)
class Residuals:
    """Residuals of (17) and of its optimality conditions, computed from the problem.

    Attributes:
        primal: Largest violation of equilibrium [N, N·m], cones, bounds [N] and limits [N·m].
        dual: Largest violation of stationarity and dual cones [per N].
        gap: |primal value - dual value| [unit of the objective].
    """

    primal: float
    dual: float
    gap: float


@dataclass(frozen=True, eq=False)
class Solution:
    """An optimal solution of (17).

    Attributes:
        problem: The problem that was solved, with the names of contacts and joints.
        value: Optimal objective [N, N·m or -].
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,); empty without joints.
        unpack: Function that returns the multipliers; called on first use, since a control loop
            needs none.
        iterations: Interior-point iterations, summed over all solves.
        solve_s: Time inside the solver [s].
    """

    problem: Problem
    value: float
    w_OC_C: Array
    tau: Array
    unpack: Callable[[], Multipliers] = field(repr=False)
    iterations: int
    solve_s: float

    @cached_property
    def multipliers(self) -> Multipliers:
        """Return the multipliers; for the friction margin those of its last parametric problem."""
        return self.unpack()

    @cached_property
    def utilisation(self) -> Array:
        """Return the friction utilisation of each contact [-], (m,)."""
        return utilisation(self.problem.contacts, self.w_OC_C)

    def wrench(self, contact: str) -> Array:
        """Return the wrench on the object at a named contact, in its axes [N, N·m], (6,)."""
        return self.w_OC_C[[c.name for c in self.problem.contacts].index(contact)]

    @cached_property
    def residuals(self) -> Residuals:
        """Return the residuals of the constraints and of the optimality conditions."""
        problem, value = self.problem, self.value
        if problem.objective is Objective.FRICTION_MARGIN:
            # The multipliers are those of the problem with its cones shrunk to the margin.
            problem, value = shrink_cones(problem, max(value, _SMALLEST_UTILISATION)), 0.0
        dual = _dual_residual(problem, self.multipliers)
        gap = abs(value - self.multipliers.value(problem))
        primal = violation(self.problem, self.w_OC_C, self.tau)
        if self.problem.joints is not None:
            torque = self.problem.torque(self.w_OC_C)
            primal = max(primal, float(np.abs(self.tau - torque).max()))
        return Residuals(primal, dual, gap)

    def page(self) -> Page:
        """Return objective, forces, joints nearest to their limits and the proof as a page."""
        problem, found = self.problem, self.residuals
        rows = []
        for contact, w, used in zip(problem.contacts, self.w_OC_C, self.utilisation, strict=True):
            soft = contact.model is ContactModel.SFCE
            forces = (f"{w[k]:z.3f}" for k in (N, T, O))
            rows.append(
                (contact.name, *forces, f"{w[M_N]:z.4f}" if soft else "", f"{100.0 * used:.1f}")
            )
        head = ("contact", "f_n [N]", "f_t [N]", "f_o [N]", "m_n [N·m]", "friction used [%]")
        objective = problem.objective
        unit = next((f" {u}" for end, u in _UNITS.items() if objective.endswith(end)), "")
        return page(
            (Marked("Solution"), f": {objective} {number(self.value, 5)}{unit}"),
            table(head, rows),
            table(("joint", "torque [N·m or N]", "limit used [%]"), self._joint_rows()),
            f"Violation {found.primal:.0e}, stationarity {found.dual:.0e}, gap {found.gap:.0e}; "
            f"{self.iterations} iterations, {1e3 * self.solve_s:.2f} ms.",
        )

    def _joint_rows(self) -> list[tuple[str, str, str]]:
        """Return the rows of the joints that use most of their torque limits."""
        joints, tau = self.problem.joints, self.tau
        if joints is None:
            return []
        limits = np.where(tau < 0.0, joints.tau_min, joints.tau_max)
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.nan_to_num(tau / limits, nan=0.0)
        order = np.argsort(-shares, kind="stable")[:_NAMED]
        return [(joints.names[k], f"{tau[k]:z.3f}", f"{100 * shares[k]:.1f}") for k in order]

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


@dataclass(frozen=True, eq=False)
class Certificate:
    """A proof that (17) has no feasible point: multipliers whose Lagrangian is always positive.

    Attributes:
        problem: The infeasible problem.
        multipliers: Multipliers, scaled to a value of 1.
    """

    problem: Problem
    multipliers: Multipliers

    @cached_property
    def residual(self) -> float:
        """Return the violation of stationarity and dual cones; a proof has << 1."""
        return _dual_residual(self.problem, self.multipliers)

    @cached_property
    def value(self) -> float:
        """Return the value of the Lagrangian; positive for a valid certificate."""
        return self.multipliers.value(self.problem)

    def proves(self, force_bound: float) -> bool:
        """Return whether no feasible forces have components up to a bound [N, N·m].

        The Lagrangian of a feasible F is at most 0, and at least ``value - |residual| |F|_1`` minus
        the contribution of multipliers outside their dual cones. Twice the sum covers both.
        """
        components = sum(len(c.model.components) for c in self.problem.contacts)
        limits = 2 * (len(self.problem.contacts) + self.multipliers.tau_max.size)
        return self.value > 2.0 * self.residual * force_bound * (components + limits)

    def heaviest(self, count: int) -> list[str]:
        """Return the names of the constraints with the largest multipliers, heaviest first."""
        return heaviest(self.multipliers.weights(self.problem), count)

    def page(self) -> Page:
        """Return the constraints that contradict each other, heaviest first, as a page."""
        weights = self.multipliers.weights(self.problem)
        rows = [(name, number(weights[name])) for name in self.heaviest(_NAMED)]
        return page(
            (
                Marked("No forces exist"),
                ": these constraints contradict each other (Farkas certificate, value "
                f"{number(self.value)}, residual {self.residual:.0e})",
            ),
            table(("constraint", "multiplier [1/N or 1/(N·m)]"), rows),
        )

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


def certificate(problem: Problem, ray: Multipliers) -> Certificate:
    """Return the certificate of an unbounded ray of multipliers, scaled to a value of 1."""
    ray = replace(ray, gradient=np.zeros(0))
    return Certificate(problem, ray.over(abs(ray.value(problem)) or 1.0))


def shrink_cones(problem: Problem, factor: float) -> Problem:
    """Return the problem with every friction coefficient multiplied by a factor > 0 [-]."""
    contacts = tuple(
        replace(c, mu=c.mu * factor) if c.model.has_friction else c for c in problem.contacts
    )
    return replace(problem, contacts=contacts)


def violation(problem: Problem, w_OC_C: Array, tau: Array) -> float:
    """Return the largest violation of (5), (6), (7), (12) or (16) [N, N·m].

    Args:
        problem: The problem.
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,).
    """
    facts, f_n = problem.contact_set, w_OC_C[:, N]
    violations = [
        np.abs(problem.imbalance(w_OC_C)),
        np.abs(w_OC_C * (1.0 - facts.transmitted)),
        np.linalg.norm(w_OC_C * facts.friction, axis=1) - f_n,
        facts.f_n_min - f_n,
        f_n - facts.f_n_max,
    ]
    if problem.joints is not None:
        violations += [tau - problem.joints.tau_max, problem.joints.tau_min - tau]
    return max(float(values.max()) for values in violations)


def _dual_residual(problem: Problem, multipliers: Multipliers) -> float:
    worst = float(np.abs(multipliers.stationarity(problem)).max())
    return max(worst, multipliers.cone_violation(problem))


class InfeasibleError(FulcrumError):
    """No contact forces satisfy all constraints of (17); `certificate` is the Farkas proof."""

    def __init__(self, certificate: Certificate) -> None:
        self.certificate = certificate
        super().__init__(
            "no contact forces keep the object in equilibrium within all limits; "
            f"most binding: {', '.join(certificate.heaviest(3))}."
        )
