r"""A certificate of infeasibility in words: which balances conflict with which limits.

The multipliers are a virtual motion: the object moves with the twist :math:`\nu`, joints at a limit
turn by :math:`\gamma`, and at each contact the two sides separate by y. In that motion the weight
and the preloads do more work than the limits can take up, whatever the forces. This is the proof,
and ``bearable`` is the limits' work over that of weight and preloads. Shares compare the sizes of
these motions in metres: rotations at the lever arm of the contact farthest from the centre of mass,
joints by the motion of the hands. They are indications and not part of the proof, but a constraint
whose share is zero is not needed for the proof.

A share does not say that relaxing this limit alone helps: if two hands squeeze, the torque limits
of each can limit the other's grip. :func:`relaxed` makes the problems to try.

An infeasible problem has many proofs. The solver's own uses almost every constraint a little. One
from the border of feasibility (:mod:`synthesis.analysis.relaxation`) uses only those that limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.synthesis import Certificate, Problem
from fulcrum.synthesis.analysis.relaxation import Change, ChangeOutcome, Kind
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.solution import certificate as make_certificate

# Smaller shares are the solver's noise and left out.
NEGLIGIBLE = 1e-4
# Relative distance from the surface of its dual cone within which a multiplier counts as on it: the
# contact slides.
_ON_EDGE = 1e-3

BALANCES = tuple(
    f"{balance} world {axis}"
    for balance in ("force balance along", "moment balance about")
    for axis in "xyz"
)


@dataclass(frozen=True)
class Conflict:
    """The constraints that contradict each other, so that no forces exist.

    Attributes:
        balances: Share of each equation of equilibrium in world axes, moments about the centre of
            mass. The shares sum to 1, heaviest first; negligible ones are left out.
        limits: Shares of friction cones, bounds and torque limits, likewise.
        asked: Demand of the weight and of each preload, as shares that sum to 1.
        given: Largest contribution of each limit, in the same unit; they sum to ``bearable``.
        bearable: Share of the demand that the limits can carry, below 1.
    """

    balances: dict[str, float]
    limits: dict[str, float]
    asked: dict[str, float]
    given: dict[str, float]
    bearable: float

    @property
    def sentence(self) -> str:
        """Return the conflict as a sentence."""
        limits = _list(self.limits)
        within = f" within {limits}" if limits else ""
        asked = and_list(list(self.asked))
        share = f"at most {100 * self.bearable:.3g} %" if self.given else "none"
        carried = f"the contacts can carry {share} of {asked}"
        return f"{_list(self.balances)} cannot be met{within}: {carried}"


def conflict(certificate: Certificate, gravity: Gravity, R_WO: Array) -> Conflict:
    """Return the conflict that a certificate proves.

    Args:
        certificate: Certificate of a problem whose external wrench contains the weight.
        gravity: The weight; moments are about its centre of mass.
        R_WO: Orientation of the object in the world, (3, 3).
    """
    problem, multipliers = certificate.problem, certificate.multipliers
    arm = float(np.linalg.norm(problem.p_OC_O - gravity.center_O, axis=1).max()) or 1.0
    nu_f, nu_m = multipliers.equilibrium[:3], multipliers.equilibrium[3:]
    nu_f = nu_f + np.cross(nu_m, gravity.center_O - problem.p_OB_O)
    motion = np.abs(np.concatenate([R_WO @ nu_f, arm * (R_WO @ nu_m)]))
    asked, given = _work(certificate)
    demand = sum(asked.values())
    return Conflict(
        balances=_shares(dict(zip(BALANCES, motion.tolist(), strict=True))),
        limits=_shares(_limit_motions(certificate, arm)),
        asked=_shares(asked),
        given=_kept({name: work / demand for name, work in given.items()}),
        bearable=sum(given.values()) / demand,
    )


def tightest(
    certificate: Certificate, found: Mapping[Kind, Change], force_bound: float = 1e4
) -> Certificate:
    """Return the proof of infeasibility that uses the fewest constraints.

    Args:
        certificate: The solver's own proof, which is returned if no other holds.
        found: Changes that make the problem feasible. Just beyond the border of less weight or
            stronger limits lies a proof that also holds for the problem itself.
        force_bound: Forces up to which the proof must hold [N].
    """
    for kind in (Kind.WEIGHT, Kind.GRIP, Kind.TORQUE):
        change = found[kind]
        if change.outcome is ChangeOutcome.BOUND and change.conflict is not None:
            proof = rebased(change.conflict, certificate.problem)
            if proof.proves(force_bound):
                return proof
    return certificate


def rebased(proof: Certificate, problem: Problem) -> Certificate:
    """Return the same multipliers for another problem, for which they may prove nothing."""
    return make_certificate(problem, proof.multipliers)


def relaxed(problem: Problem, share: float) -> dict[str, Problem]:
    """Return problems in which one limit is relaxed by a share of it, by the limit's name."""
    problems = {}
    for i, contact in enumerate(problem.contacts):
        for name, looser in (
            ("friction", replace(contact, mu=(1.0 + share) * contact.mu)),
            ("grip limit", replace(contact, f_n_max=(1.0 + share) * contact.f_n_max)),
            ("preload", replace(contact, f_n_min=(1.0 - share) * contact.f_n_min)),
        ):
            contacts = (*problem.contacts[:i], looser, *problem.contacts[i + 1 :])
            problems[f"{name} of {contact.name}"] = replace(problem, contacts=contacts)
    joints = problem.joints
    for k, name in enumerate(joints.names if joints else ()):
        assert joints is not None
        more = np.zeros(len(joints.names))
        more[k] = share
        stronger = replace(
            joints,
            tau_min=joints.tau_min - more * np.abs(joints.tau_min),
            tau_max=joints.tau_max + more * np.abs(joints.tau_max),
        )
        problems[f"torque limit of {name}"] = replace(problem, joints=stronger)
    return problems


def _limit_motions(certificate: Certificate, arm: float) -> dict[str, float]:
    """Return the size of the virtual motion that each limit resists [m per unit of work]."""
    problem, multipliers = certificate.problem, certificate.multipliers
    sizes = {}
    for i, contact in enumerate(problem.contacts):
        y = multipliers.cone[i, list(contact.model.components)] * contact.scale
        slides = np.linalg.norm(y[1:]) > (1.0 - _ON_EDGE) * y[0]
        name = f"friction of {contact.name}" if slides else f"{contact.name} that can only push"
        sizes[name] = float(multipliers.cone[i, N])
        sizes[f"preload of {contact.name}"] = float(multipliers.f_n_min[i])
        sizes[f"grip limit of {contact.name}"] = float(multipliers.f_n_max[i])
    for k, (name, lever) in enumerate(_levers(problem, arm).items()):
        gamma = max(multipliers.tau_max[k], multipliers.tau_min[k])
        sizes[f"torque limit of {name}"] = float(lever * gamma)
    return sizes


def _levers(problem: Problem, arm: float) -> dict[str, float]:
    """Return the motion of the hand that each joint moves most [m per rad, or 1]."""
    joints = problem.joints
    if joints is None:
        return {}
    J = joints.J_C * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    levers = np.linalg.norm(J, axis=1).max(axis=0)
    # A joint that moves no hand may still be too weak for its own arm.
    levers[levers == 0.0] = arm
    return dict(zip(joints.names, levers.tolist(), strict=True))


def _work(certificate: Certificate) -> tuple[dict[str, float], dict[str, float]]:
    """Return the terms of the certificate's value: work demanded, and work of the limits."""
    problem, multipliers = certificate.problem, certificate.multipliers
    terms = {"the weight": float(multipliers.equilibrium @ problem.w_ext_B)}
    for contact, alpha, beta in zip(
        problem.contacts, multipliers.f_n_min, multipliers.f_n_max, strict=True
    ):
        terms[f"the preload of {contact.name}"] = float(alpha) * contact.f_n_min
        if np.isfinite(contact.f_n_max):
            terms[f"grip limit of {contact.name}"] = -float(beta) * contact.f_n_max
    joints = problem.joints
    if joints is not None:
        for k, name in enumerate(joints.names):
            work = 0.0
            if np.isfinite(joints.tau_max[k]):
                work += multipliers.tau_max[k] * (joints.tau_g[k] - joints.tau_max[k])
            if np.isfinite(joints.tau_min[k]):
                work += multipliers.tau_min[k] * (joints.tau_min[k] - joints.tau_g[k])
            # Above 0 the arm cannot hold itself up.
            kind = "the weight of the arm at" if work > 0.0 else "torque limit of"
            terms[f"{kind} {name}"] = float(work)
    asked = {name: work for name, work in terms.items() if work > 0.0}
    given = {name: -work for name, work in terms.items() if work < 0.0}
    return asked, given


def _shares(sizes: dict[str, float]) -> dict[str, float]:
    """Return the sizes over their sum, heaviest first, without negligible ones."""
    total = sum(sizes.values())
    kept = _kept({name: size / total for name, size in sizes.items()} if total > 0.0 else {})
    total = sum(kept.values())
    return {name: share / total for name, share in kept.items()}


def _kept(shares: dict[str, float]) -> dict[str, float]:
    kept = [name for name, share in shares.items() if share > NEGLIGIBLE]
    return {name: shares[name] for name in sorted(kept, key=lambda name: -shares[name])}


def _list(shares: dict[str, float]) -> str:
    return and_list([f"{name} ({100 * share:.3g} %)" for name, share in shares.items()])


def and_list(words: list[str]) -> str:
    """Return words as an English list: "a, b and c"."""
    return " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)
