r"""How far a problem is from being feasible, or infeasible: the smallest change of a single kind.

Four kinds of change are looked at, each by one factor k: all friction coefficients times k, all
torque limits times k, the object's weight times k, all finite grip limits times k. The constraints
are affine in the last three; their feasible factors are an interval, whose ends
:mod:`synthesis.analysis.factor` computes. Friction multiplies forces: the cones of a smaller factor
lie within those of a larger one, so that feasibility is quasi-convex in it, and the smallest
feasible factor is bisected.

Every factor found is confirmed: the changed problem is solved again a little to either side of it
by the :class:`Synthesizer`, which has to find forces on the one and a certificate of infeasibility
on the other. That certificate says what holds the factor back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from fulcrum.synthesis import (
    Certificate,
    ContactModel,
    InfeasibleError,
    Objective,
    Problem,
    SolverError,
    Synthesizer,
)
from fulcrum.synthesis.analysis.factor import EmptyRangeError, factor_range
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.solution import shrink_cones

# How far to either side of a factor it is confirmed, relative. The first is a thousand solver
# tolerances; the others serve where forces are a hundred and more times the weight.
_CONFIRMATIONS = (1e-6, 1e-5, 1e-4)
# The bisection's last interval, relative.
_BISECTED = 1e-7
# Friction is tried in steps of this factor, so many to either side of 1.
_FRICTION_STEP, _FRICTION_STEPS = 4.0, 5
# The weight, over the given one, with which "any weight can be held" is confirmed.
_MUCH_WEIGHT = 1e3


class Kind(StrEnum):
    """What is multiplied by the factor."""

    FRICTION = "friction coefficients"
    TORQUE = "torque limits"
    WEIGHT = "weight"
    GRIP = "grip limits"


class ChangeOutcome(StrEnum):
    """What was found about a kind of change.

    BOUND: the feasible factors end at the one given. ALWAYS: no factor on the harmful side makes
    the problem infeasible. NEVER: no factor makes it feasible. ABSENT: it has nothing of the kind.
    """

    BOUND = "bound"
    ALWAYS = "always"
    NEVER = "never"
    ABSENT = "absent"


@dataclass(frozen=True, eq=False)
class Change:
    """One kind of change, and how much of it a problem needs to be feasible, or bears.

    Attributes:
        kind: What is multiplied.
        outcome: What was found.
        factor: The end of the feasible factors [-]: for an infeasible problem the one nearest to 1,
            for a feasible one that on the harmful side. For ``ALWAYS`` the most harmful factor
            that was looked at (0, infinity for the weight; friction is not looked at beyond about
            1000 times either way), for ``NEVER`` and friction the most helpful one; else 1.
        confirmed_within: How near to the factor, relative, solving again tells feasible from
            infeasible [-]; 0 where there is no such border, infinite if it could not be confirmed.
        conflict: What stands in the way: the certificate just beyond the factor or, for ``NEVER``,
            of the problem with as much of the change as can be.
    """

    kind: Kind
    outcome: ChangeOutcome
    factor: float = 1.0
    confirmed_within: float = 0.0
    conflict: Certificate | None = None


def changes(problem: Problem, gravity: Gravity, synthesizer: Synthesizer) -> dict[Kind, Change]:
    """For each kind of change how much of it a problem needs, or bears.

    Args:
        problem: A problem with a hand, whose external wrench contains the weight.
        gravity: The weight.
        synthesizer: Confirms what is found.

    Raises:
        SolverError: The solver stopped without an answer.
    """
    return {kind: change(kind, problem, gravity, synthesizer) for kind in Kind}


def change(kind: Kind, problem: Problem, gravity: Gravity, synthesizer: Synthesizer) -> Change:
    """What :func:`changes` gives for one kind."""
    problem = _bare(problem)
    if kind is Kind.FRICTION:
        return _friction_change(problem, synthesizer)
    if kind is Kind.WEIGHT:
        return _linear_change(kind, _weighted(problem, gravity), synthesizer)
    if kind is Kind.GRIP:
        if not any(np.isfinite(c.f_n_max) for c in problem.contacts):
            return Change(kind, ChangeOutcome.ABSENT)
        return _linear_change(kind, _with_grip(problem), synthesizer)
    joints = problem.joints
    if joints is None or not np.isfinite([joints.tau_min, joints.tau_max]).any():
        return Change(kind, ChangeOutcome.ABSENT)
    return _linear_change(kind, _with_torque(problem), synthesizer)


def weight_range(
    problem: Problem, gravity: Gravity, synthesizer: Synthesizer
) -> tuple[float, float]:
    """The lightest and the heaviest object that can be held in the pose of a problem [N].

    The external wrench beside the weight stays what it is. A preload may ask for some weight.

    Returns:
        The range; its upper end is infinite where a stronger grip bears any weight.

    Raises:
        InfeasibleError: No weight can be held; carries the certificate for no weight.
        SolverError: The solver stopped without an answer.
    """
    family = _weighted(_bare(problem), gravity)
    try:
        low, high = factor_range(family.at)
    except EmptyRangeError:
        synthesizer.solve(family.loosest)
        raise SolverError("PrimalInfeasible for all weights, but not for none") from None
    return low * gravity.weight, high * gravity.weight


@dataclass(frozen=True)
class _Family:
    """Problems by the factor.

    Attributes:
        at: The problem at a factor.
        loosest: The problem at the factor that helps most.
        lowest: Below this factor the numbers contradict themselves (a grip limit below a preload).
    """

    at: Callable[[float], Problem]
    loosest: Problem
    lowest: float = 0.0


def _bare(problem: Problem) -> Problem:
    """The problem with an objective that is always bounded: only feasibility matters here."""
    return replace(problem, objective=Objective.MAX_NORMAL_FORCE)


def _weighted(problem: Problem, gravity: Gravity) -> _Family:
    wrench_O = gravity.wrench_O
    other = problem.w_ext_O - wrench_O
    return _Family(
        at=lambda k: replace(problem, w_ext_O=other + k * wrench_O),
        loosest=replace(problem, w_ext_O=other),
    )


def _with_torque(problem: Problem) -> _Family:
    joints = problem.joints
    assert joints is not None
    none = np.full(len(joints.names), np.inf)

    def scaled(limits: Array, k: float) -> Array:
        result = limits.copy()
        result[np.isfinite(limits)] *= k
        return result

    def at(k: float) -> Problem:
        tau_min, tau_max = scaled(joints.tau_min, k), scaled(joints.tau_max, k)
        return replace(problem, joints=replace(joints, tau_min=tau_min, tau_max=tau_max))

    return _Family(at, replace(problem, joints=replace(joints, tau_min=-none, tau_max=none)))


def _with_grip(problem: Problem) -> _Family:
    def at(k: float) -> Problem:
        contacts = (
            replace(c, f_n_max=k * c.f_n_max) if np.isfinite(c.f_n_max) else c
            for c in problem.contacts
        )
        return replace(problem, contacts=tuple(contacts))

    contacts = tuple(replace(c, f_n_max=math.inf) for c in problem.contacts)
    lowest = max(c.f_n_min / c.f_n_max if c.f_n_min else 0.0 for c in problem.contacts)
    return _Family(at, replace(problem, contacts=contacts), lowest)


def _linear_change(kind: Kind, family: _Family, synthesizer: Synthesizer) -> Change:
    try:
        low, high = factor_range(family.at)
    except EmptyRangeError:
        conflict = _conflict(family.loosest, synthesizer)
        within = math.inf if conflict is None else 0.0
        return Change(kind, ChangeOutcome.NEVER, 1.0, within, conflict)
    feasible = _conflict(family.at(1.0), synthesizer) is None
    upwards = kind is Kind.WEIGHT if feasible else high < 1.0
    factor, other = (high, low) if upwards else (low, high)
    if factor == math.inf or (factor == 0.0 and not upwards):
        conflict = _conflict(family.at(min(factor, _MUCH_WEIGHT)), synthesizer)
        return Change(kind, ChangeOutcome.ALWAYS, factor, 0.0 if conflict is None else math.inf)
    return _confirmed(kind, family, factor, other, synthesizer)


def _friction_change(problem: Problem, synthesizer: Synthesizer) -> Change:
    """Bisects the factor between one that is feasible and one that is not."""
    kind = Kind.FRICTION
    if all(c.model is ContactModel.FRICTIONLESS for c in problem.contacts):
        return Change(kind, ChangeOutcome.ABSENT)
    family = _Family(at=lambda k: shrink_cones(problem, k), loosest=problem)
    conflict = _conflict(problem, synthesizer)
    last, infeasible = 1.0, conflict is not None
    for _ in range(_FRICTION_STEPS):
        factor = last * _FRICTION_STEP if infeasible else last / _FRICTION_STEP
        try:
            beyond = _conflict(family.at(factor), synthesizer)
        except SolverError:  # Such friction is out of the solver's reach.
            break
        if (beyond is not None) is not infeasible:
            low, high = (last, factor) if infeasible else (factor, last)
            factor = _bisected(family, low, high, synthesizer)
            return _confirmed(kind, family, factor, math.inf, synthesizer)
        last, conflict = factor, beyond
    return Change(
        kind, ChangeOutcome.NEVER if infeasible else ChangeOutcome.ALWAYS, last, 0.0, conflict
    )


def _bisected(family: _Family, low: float, high: float, synthesizer: Synthesizer) -> float:
    """The smallest feasible factor, between an infeasible and a feasible one."""
    while high > low * (1.0 + _BISECTED):
        middle = math.sqrt(low * high)
        try:
            feasible = _conflict(family.at(middle), synthesizer) is None
        except SolverError:  # On the brink; whether the factor is right is confirmed afterwards.
            feasible = False
        low, high = (low, middle) if feasible else (middle, high)
    return high


def _confirmed(
    kind: Kind, family: _Family, factor: float, other: float, synthesizer: Synthesizer
) -> Change:
    """A bound, with what solving on both sides of it says.

    Args:
        kind: What is multiplied.
        family: The problems.
        factor: The end of the feasible factors in question.
        other: Their other end.
        synthesizer: Solves.
    """
    sign = 1.0 if factor > other else -1.0
    conflict = None
    for within in _CONFIRMATIONS:
        # A range of factors may be a single point.
        inside = sign * max(sign * factor * (1.0 - sign * within), sign * other)
        outside = factor * (1.0 + sign * within)
        contradictory = outside < family.lowest
        try:
            conflict = None if contradictory else _conflict(family.at(outside), synthesizer)
            held = _conflict(family.at(inside), synthesizer) is None
        except SolverError:  # Too near to the brink to tell.
            continue
        if held and (contradictory or conflict is not None):
            return Change(kind, ChangeOutcome.BOUND, factor, within, conflict)
    return Change(kind, ChangeOutcome.BOUND, factor, math.inf, conflict)


def _conflict(problem: Problem, synthesizer: Synthesizer) -> Certificate | None:
    """The certificate of an infeasible problem; None of a feasible one."""
    try:
        synthesizer.solve(problem)
    except InfeasibleError as error:
        return error.certificate
    return None
