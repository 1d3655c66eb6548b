"""Solutions and infeasibility certificates that prove themselves, without the solver.

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

# How many joints and constraints a table names.
_NAMED = 6
_UNITS = {"normal-force": "N", "torque": "N·m"}


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Lagrange multipliers by the names of their constraints.

    Attributes:
        equilibrium: nu, (6,): change of the optimal objective per change of ``w_ext_B``, which is
            ``w_ext_O`` unless the object frame is far from the contacts.
        cone: y, (m, 6), on transmitted components: an element of the dual friction cone.
        f_n_min: alpha >= 0, (m,).
        f_n_max: beta >= 0, (m,).
        tau_min: gamma- >= 0, (l,).
        tau_max: gamma+ >= 0, (l,).
        gradient: A subgradient of the objective in F_n, (n,), or in tau, (l,); empty for the
            friction margin and for a certificate.
    """

    equilibrium: Array
    cone: Array
    f_n_min: Array
    f_n_max: Array
    tau_min: Array
    tau_max: Array
    gradient: Array

    def stationarity(self, problem: Problem) -> Array:
        """Gradient of the Lagrangian in the wrenches, (m, 6), zero in untransmitted components."""
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
        return residual * _transmitted(problem)

    def value(self, problem: Problem) -> float:
        """Value of the Lagrangian where it is stationary: the dual objective."""
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
        """How far any multiplier lies outside its dual cone; 0 or less inside."""
        worst = max(
            (-float(v.min()) for v in self._nonnegative() if v.size),
            default=0.0,
        )
        for contact, y in zip(problem.contacts, self.cone, strict=True):
            scaled = y[list(contact.model.components)] * contact.scale
            worst = max(worst, float(np.linalg.norm(scaled[1:]) - scaled[0]))
        return worst

    def _nonnegative(self) -> tuple[Array, ...]:
        return self.f_n_min, self.f_n_max, self.tau_min, self.tau_max

    def weights(self, problem: Problem) -> dict[str, float]:
        """Size of each constraint's multiplier by its name, each in its own dual unit."""
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


# A utilisation of 0 (normal forces alone balance the object) would leave no cone to speak of.
_SMALLEST_UTILISATION = 1e-9

_AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")


def _transmitted(problem: Problem) -> Array:
    mask = np.zeros((len(problem.contacts), 6))
    for i, contact in enumerate(problem.contacts):
        mask[i, list(contact.model.components)] = 1.0
    return mask


@dataclass(frozen=True)
class Residuals:
    """How well a solution satisfies (17) and its optimality conditions, computed from the problem.

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
        problem: What was solved; contacts, joints and limits keep their names through it.
        value: Optimal objective [N, N·m or -].
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (m, 6).
        tau: Joint torques [N·m or N], (l,); empty without joints.
        unpack: Gives the multipliers; called once they are asked for, for a loop asks for none.
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
        """The duals; for the friction margin those of its last parametric problem."""
        return self.unpack()

    @cached_property
    def utilisation(self) -> Array:
        """Friction utilisation of each contact [-], (m,)."""
        return utilisation(self.problem.contacts, self.w_OC_C)

    def wrench(self, contact: str) -> Array:
        """Wrench on the object at the named contact, in its axes [N, N·m], (6,)."""
        return self.w_OC_C[[c.name for c in self.problem.contacts].index(contact)]

    @cached_property
    def residuals(self) -> Residuals:
        """The proof: residuals of the constraints and of the optimality conditions."""
        return Residuals(
            primal=self._primal_residual(),
            dual=self._dual_residual(),
            gap=self._gap(),
        )

    def _primal_residual(self) -> float:
        problem, f_n = self.problem, self.w_OC_C[:, N]
        balance = np.einsum("mkj,mj->k", problem.G, self.w_OC_C) + problem.w_ext_B
        worst = float(np.abs(balance).max())
        worst = max(worst, float(np.abs(self.w_OC_C * (1.0 - _transmitted(problem))).max()))
        for contact, w in zip(problem.contacts, self.w_OC_C, strict=True):
            tangential = w[list(contact.model.components[1:])] / contact.scale[1:]
            worst = max(worst, float(np.linalg.norm(tangential)) - w[N])
        worst = max(worst, *(c.f_n_min - f for c, f in zip(problem.contacts, f_n, strict=True)))
        worst = max(worst, *(f - c.f_n_max for c, f in zip(problem.contacts, f_n, strict=True)))
        if problem.joints is not None:
            worst = max(worst, float((self.tau - problem.joints.tau_max).max()))
            worst = max(worst, float((problem.joints.tau_min - self.tau).max()))
            worst = max(worst, float(np.abs(self.tau - problem.torque(self.w_OC_C)).max()))
        return worst

    def _parametric(self) -> Problem:
        """The problem whose multipliers are held: for the friction margin, cones shrunk to it."""
        if self.problem.objective is not Objective.FRICTION_MARGIN:
            return self.problem
        return shrink_cones(self.problem, max(self.value, _SMALLEST_UTILISATION))

    def _dual_residual(self) -> float:
        problem = self._parametric()
        worst = float(np.abs(self.multipliers.stationarity(problem)).max())
        return max(worst, self.multipliers.cone_violation(problem))

    def _gap(self) -> float:
        dual = self.multipliers.value(self._parametric())
        if self.problem.objective is Objective.FRICTION_MARGIN:
            return abs(dual)
        return abs(self.value - dual)

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
        """The joints that use most of their torque limits."""
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
    """Proof that (17) has no feasible point: multipliers whose Lagrangian is always positive.

    Attributes:
        problem: The infeasible problem.
        multipliers: Scaled so that their value is 1.
    """

    problem: Problem
    multipliers: Multipliers

    @cached_property
    def residual(self) -> float:
        """Violation of stationarity and dual cones relative to a value of 1; proves if << 1."""
        worst = float(np.abs(self.multipliers.stationarity(self.problem)).max())
        return max(worst, self.multipliers.cone_violation(self.problem))

    @cached_property
    def value(self) -> float:
        """Value of the Lagrangian; positive for a valid certificate."""
        return self.multipliers.value(self.problem)

    def proves(self, force_bound: float) -> bool:
        """Whether no feasible forces exist with transmitted components up to a bound [N, N·m].

        The Lagrangian of a feasible F is at most 0, but at least ``value - |residual| |F|_1``
        less what multipliers outside their dual cones may add; both are covered by twice the sum.
        """
        components = sum(len(c.model.components) for c in self.problem.contacts)
        limits = 2 * (len(self.problem.contacts) + self.multipliers.tau_max.size)
        return self.value > 2.0 * self.residual * force_bound * (components + limits)

    def heaviest(self, count: int) -> list[str]:
        """Names of the constraints with the largest multipliers, heaviest first."""
        weights = self.multipliers.weights(self.problem)
        return sorted((n for n in weights if weights[n] > 0.0), key=lambda n: -weights[n])[:count]

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
    """The certificate made of an unbounded ray of multipliers, scaled to a value of 1."""
    ray = replace(ray, gradient=np.zeros(0))
    value = abs(ray.value(problem)) or 1.0
    scaled = {f.name: getattr(ray, f.name) / value for f in fields(ray)}
    return Certificate(problem=problem, multipliers=Multipliers(**scaled))


def shrink_cones(problem: Problem, factor: float) -> Problem:
    """The problem with every friction coefficient multiplied by a factor > 0 [-]."""
    contacts = tuple(
        c if c.model is ContactModel.FRICTIONLESS else replace(c, mu=c.mu * factor)
        for c in problem.contacts
    )
    return replace(problem, contacts=contacts)


class InfeasibleError(FulcrumError):
    """No contact forces satisfy all constraints of (17); carries the Farkas certificate."""

    def __init__(self, certificate: Certificate) -> None:
        self.certificate = certificate
        super().__init__(
            "no contact forces keep the object in equilibrium within all limits; "
            f"most binding: {', '.join(certificate.heaviest(3))}."
        )
