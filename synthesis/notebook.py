"""What notebooks show of a problem, its solution, or the proof that it has none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fulcrum.synthesis.arrays import M_N, N, O, T
from fulcrum.synthesis.contact import ContactModel
from fulcrum.synthesis.markdown import escaped, number, numbers, page, table

if TYPE_CHECKING:
    from fulcrum.synthesis.problem import Problem
    from fulcrum.synthesis.solution import Certificate, Solution

# How many joints and constraints a table names.
_NAMED = 6
_UNITS = {"normal-force": "N", "torque": "N·m"}


def problem_markdown(problem: Problem) -> str:
    """Contacts, external wrench and joints of a problem."""
    rows = []
    for contact, p in zip(problem.contacts, problem.p_OC_O, strict=True):
        rough = contact.model is not ContactModel.FRICTIONLESS
        rows.append(
            (
                contact.name,
                contact.role,
                contact.model,
                number(contact.mu) if rough else "",
                number(contact.e_n) if contact.model is ContactModel.SFCE else "",
                f"{number(contact.f_n_min)} to {number(contact.f_n_max)}",
                numbers(p, 3),
            )
        )
    head = ("contact", "role", "model", "μ", "e_n [m]", "f_n [N]", "place on the object [m]")
    force, moment = map(numbers, np.split(problem.w_ext_O, 2))
    joints = problem.joints
    return page(
        f"**Problem (17)**: minimise {escaped(problem.objective)}",
        table(head, rows),
        f"External force ({force}) N, moment ({moment}) N·m, in the object's axes.",
        "No joints: torques are not limited."
        if joints is None
        else f"{len(joints.names)} joints: {escaped(', '.join(joints.names))}.",
    )


def solution_markdown(solution: Solution) -> str:
    """Objective, forces and their friction, the joints nearest to their limits, and the proof."""
    problem, found = solution.problem, solution.residuals
    rows = []
    for contact, w, used in zip(
        problem.contacts, solution.w_OC_C, solution.utilisation, strict=True
    ):
        soft = contact.model is ContactModel.SFCE
        forces = (f"{w[k]:z.3f}" for k in (N, T, O))
        rows.append(
            (contact.name, *forces, f"{w[M_N]:z.4f}" if soft else "", f"{100.0 * used:.1f}")
        )
    head = ("contact", "f_n [N]", "f_t [N]", "f_o [N]", "m_n [N·m]", "friction used [%]")
    objective = problem.objective
    unit = next((f" {u}" for end, u in _UNITS.items() if objective.endswith(end)), "")
    return page(
        f"**Solution**: {escaped(objective)} {number(solution.value, 5)}{unit}",
        table(head, rows),
        table(("joint", "torque [N·m or N]", "limit used [%]"), _joints(solution)),
        f"Violation {found.primal:.0e}, stationarity {found.dual:.0e}, gap {found.gap:.0e}; "
        f"{solution.iterations} iterations, {1e3 * solution.solve_s:.2f} ms.",
    )


def _joints(solution: Solution) -> list[tuple[str, str, str]]:
    """The joints that use most of their torque limits."""
    joints = solution.problem.joints
    if joints is None:
        return []
    limits = np.where(solution.tau < 0.0, joints.tau_min, joints.tau_max)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.nan_to_num(solution.tau / limits, nan=0.0)
    order = np.argsort(-shares, kind="stable")[:_NAMED]
    return [(joints.names[k], f"{solution.tau[k]:z.3f}", f"{100 * shares[k]:.1f}") for k in order]


def certificate_markdown(certificate: Certificate) -> str:
    """The constraints that contradict each other, heaviest first."""
    weights = certificate.multipliers.weights(certificate.problem)
    rows = [(name, number(weights[name])) for name in certificate.heaviest(_NAMED)]
    return page(
        "**No forces exist**: these constraints contradict each other (Farkas certificate, "
        f"value {number(certificate.value)}, residual {certificate.residual:.0e})",
        table(("constraint", "multiplier [1/N or 1/(N·m)]"), rows),
    )
