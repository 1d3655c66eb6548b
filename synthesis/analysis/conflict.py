r"""A certificate of infeasibility in words: which balances conflict with which limits.

Its multipliers are a virtual motion: the object moves with the twist :math:`\nu`, joints at a limit
turn by :math:`\gamma`, and at each contact the two sides part by y. In that motion the weight and
the preloads do more work than the limits can take up, whatever the forces: this is the proof, and
``bearable`` is the limits' work over that of weight and preloads. Shares compare the sizes of these
motions in metres: rotations count at the arm of the contact that is farthest from the centre of
mass, joints as they move the hands. They are indications, not part of the proof; a share of zero is
exact: such a constraint is not needed for it.

Nor does a share say that relaxing that limit alone helps: where two hands squeeze, each one's
torque limit can hold the other's grip back by itself (:func:`relaxed` serves to try).

An infeasible problem has many proofs. The solver's own leans a little on everything; one from the
border of feasibility (:mod:`synthesis.analysis.relaxation`) leans on what really holds the border.
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

# Shares below this are the solver's noise and left out.
NEGLIGIBLE = 1e-4
# How near to the edge of its dual cone a multiplier counts as on it: there the contact slides.
_ON_EDGE = 1e-3

BALANCES = (
    "force balance along world x",
    "force balance along world y",
    "force balance along world z",
    "moment balance about world x",
    "moment balance about world y",
    "moment balance about world z",
)


@dataclass(frozen=True)
class Conflict:
    """Why no forces exist.

    Attributes:
        balances: Share of each of the equations of equilibrium in world axes, with moments about
            the centre of mass; they add up to 1, heaviest first, negligible ones left out.
        limits: The same of friction cones, bounds and torque limits.
        asked: What the weight and each preload ask for, as shares that add up to 1.
        given: What each limit can give at most, in the same measure; they add up to ``bearable``.
        bearable: Share of what is asked for that the limits can give, below 1.
    """

    balances: dict[str, float]
    limits: dict[str, float]
    asked: dict[str, float]
    given: dict[str, float]
    bearable: float

    @property
    def sentence(self) -> str:
        """The conflict for a roboticist."""
        balances, limits = _list(self.balances), _list(self.limits)
        text = (
            f"{balances} cannot be met within {limits}" if limits else f"{balances} cannot be met"
        )
        asked = and_list(list(self.asked)) + (" asks" if len(self.asked) == 1 else " ask")
        if not self.given:
            return f"{text}: nothing there can give what {asked} for"
        return f"{text}: at most {100 * self.bearable:.3g} % of what {asked} for can be given"


def conflict(certificate: Certificate, gravity: Gravity, R_WO: Array) -> Conflict:
    """The conflict that a certificate proves.

    Args:
        certificate: Of a problem whose external wrench contains the weight.
        gravity: The weight, with the centre of mass for moments to be about.
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
    """The sharpest proof at hand that a problem is infeasible.

    Args:
        certificate: The solver's own.
        found: Changes that make the problem feasible; just beyond the border of less weight or
            stronger limits lies a proof that also holds for the problem itself.
        force_bound: Forces up to which it has to prove [N].
    """
    for kind in (Kind.WEIGHT, Kind.GRIP, Kind.TORQUE):
        change = found[kind]
        if change.outcome is ChangeOutcome.BOUND and change.conflict is not None:
            proof = rebased(change.conflict, certificate.problem)
            if proof.proves(force_bound):
                return proof
    return certificate


def rebased(proof: Certificate, problem: Problem) -> Certificate:
    """The same multipliers for a problem with other loads and limits; may prove nothing there."""
    return make_certificate(problem, proof.multipliers)


def relaxed(problem: Problem, share: float) -> dict[str, Problem]:
    """The problem with one limit at a time relaxed by a share of it, by the limit's name."""
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
    """Size of the virtual motion that each limit stands against [m per unit of work]."""
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
    """How much each joint moves the hand that it moves most [m per rad, or 1]."""
    joints = problem.joints
    if joints is None:
        return {}
    J = joints.J_C * np.array([1.0, 1.0, 1.0, arm, arm, arm])[:, None]
    levers = np.linalg.norm(J, axis=1).max(axis=0)
    # A joint that moves no hand can still fail to hold its own arm.
    levers[levers == 0.0] = arm
    return dict(zip(joints.names, levers.tolist(), strict=True))


def _work(certificate: Certificate) -> tuple[dict[str, float], dict[str, float]]:
    """The terms of the certificate's value: work asked for, and work that limits can give."""
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
            if work > 0.0:  # The arm cannot hold itself up.
                terms[f"the weight of the arm at {name}"] = float(work)
            else:
                terms[f"torque limit of {name}"] = float(work)
    asked = {name: work for name, work in terms.items() if work > 0.0}
    given = {name: -work for name, work in terms.items() if work < 0.0}
    return asked, given


def _shares(sizes: dict[str, float]) -> dict[str, float]:
    """Sizes over their sum, heaviest first, without the negligible ones."""
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
    """Words as English lists them."""
    return " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)
