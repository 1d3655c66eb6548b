r"""The smallest change of a single kind that makes a problem feasible, or infeasible.

There are four kinds of change, each with one factor k: all friction coefficients times k, all
torque limits times k, the object's weight times k, all finite grip limits times k. The constraints
are affine in the last three; their feasible factors are an interval, whose ends
:mod:`synthesis.analysis.factor` computes. Friction multiplies forces: the cones of a smaller factor
lie within those of a larger one, so that feasibility is quasi-convex in it, and the smallest
feasible factor is bisected.

Every factor is confirmed: the :class:`Synthesizer` solves the changed problem again a little to
either side of it, and must find forces on one side and a certificate of infeasibility on the other.
That certificate says what limits the factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from fulcrum.synthesis import (
    Certificate,
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

# Relative distances at which a factor is confirmed. The first is a thousand solver tolerances; the
# others are for forces of more than a hundred times the weight.
_CONFIRMATIONS = (1e-6, 1e-5, 1e-4)
# Last interval of the bisection, relative.
_BISECTED = 1e-7
# Friction is tried in steps of this factor, and this many steps to either side of 1.
_FRICTION_STEP, _FRICTION_STEPS = 4.0, 5
# Multiple of the weight with which "any weight can be held" is confirmed.
_MUCH_WEIGHT = 1e3


class Kind(StrEnum):
    """The quantity that a factor multiplies."""

    FRICTION = "friction coefficients"
    TORQUE = "torque limits"
    WEIGHT = "weight"
    GRIP = "grip limits"


class ChangeOutcome(StrEnum):
    """The result for a kind of change.

    BOUND: the feasible factors end at the given factor. ALWAYS: no factor on the harmful side makes
    the problem infeasible. NEVER: no factor makes it feasible. ABSENT: the problem has no such
    quantity.
    """

    BOUND = "bound"
    ALWAYS = "always"
    NEVER = "never"
    ABSENT = "absent"


@dataclass(frozen=True, eq=False)
class Change:
    """One kind of change, with the factor that makes a problem feasible or infeasible.

    Attributes:
        kind: The quantity that is multiplied.
        outcome: The result.
        factor: End of the feasible factors [-]: for an infeasible problem the one nearest to 1, for
            a feasible one that on the harmful side. For ``ALWAYS`` the most harmful factor tried
            (0, or infinity for the weight; friction up to about 1000 times either way), for
            ``NEVER`` and friction the most helpful one; else 1.
        confirmed_within: Relative distance from the factor at which solving again separates
            feasible from infeasible [-]; 0 without a border, infinite if not confirmed.
        conflict: Certificate just beyond the factor; for ``NEVER`` that of the largest change.
    """

    kind: Kind
    outcome: ChangeOutcome
    factor: float = 1.0
    confirmed_within: float = 0.0
    conflict: Certificate | None = None


def changes(problem: Problem, gravity: Gravity, synthesizer: Synthesizer) -> dict[Kind, Change]:
    """Return for each kind the smallest change that makes a problem feasible, or infeasible.

    Args:
        problem: Problem with a hand, whose external wrench contains the weight.
        gravity: The weight.
        synthesizer: Solver that confirms each factor.

    Raises:
        SolverError: The solver stopped without an answer.
    """
    return {kind: change(kind, problem, gravity, synthesizer) for kind in Kind}


def change(kind: Kind, problem: Problem, gravity: Gravity, synthesizer: Synthesizer) -> Change:
    """Return the change of one kind; see :func:`changes`."""
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
    """Return the least and the largest weight that can be held in the pose of a problem [N].

    The rest of the external wrench does not change. A preload may need some weight. The largest
    weight is infinite if a stronger grip carries any weight.

    Raises:
        InfeasibleError: No weight can be held; carries the certificate for zero weight.
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
    """The problems of one kind of change.

    Attributes:
        at: Function that returns the problem at a factor.
        loosest: Problem at the factor that helps most.
        lowest: Smallest valid factor: below it a grip limit is below a preload.
    """

    at: Callable[[float], Problem]
    loosest: Problem
    lowest: float = 0.0


def _bare(problem: Problem) -> Problem:
    """Return the problem with an objective that is always bounded: only feasibility matters."""
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
    """Bisect the factor between a feasible and an infeasible one."""
    kind = Kind.FRICTION
    if not problem.contact_set.rough.any():
        return Change(kind, ChangeOutcome.ABSENT)
    family = _Family(at=lambda k: shrink_cones(problem, k), loosest=problem)
    conflict = _conflict(problem, synthesizer)
    last, infeasible = 1.0, conflict is not None
    for _ in range(_FRICTION_STEPS):
        factor = last * _FRICTION_STEP if infeasible else last / _FRICTION_STEP
        try:
            beyond = _conflict(family.at(factor), synthesizer)
        except SolverError:  # The solver cannot solve such friction.
            break
        if (beyond is not None) is not infeasible:
            low, high = (last, factor) if infeasible else (factor, last)
            factor = _bisected(family, low, high, synthesizer)
            return _confirmed(kind, family, factor, math.inf, synthesizer)
        last, conflict = factor, beyond
    outcome = ChangeOutcome.NEVER if infeasible else ChangeOutcome.ALWAYS
    return Change(kind, outcome, last, 0.0, conflict)


def _bisected(family: _Family, low: float, high: float, synthesizer: Synthesizer) -> float:
    """Return the smallest feasible factor between an infeasible and a feasible one."""
    while high > low * (1.0 + _BISECTED):
        middle = math.sqrt(low * high)
        try:
            feasible = _conflict(family.at(middle), synthesizer) is None
        except SolverError:  # At the border; the factor is confirmed afterwards.
            feasible = False
        low, high = (low, middle) if feasible else (middle, high)
    return high


def _confirmed(
    kind: Kind, family: _Family, factor: float, other: float, synthesizer: Synthesizer
) -> Change:
    """Return a bound that is confirmed by solving on both sides of it.

    Args:
        kind: The quantity that is multiplied.
        family: The problems.
        factor: End of the feasible factors to confirm.
        other: Their other end.
        synthesizer: Solver.
    """
    sign = 1.0 if factor > other else -1.0
    conflict = None
    for within in _CONFIRMATIONS:
        # The range of factors may be a single point.
        inside = sign * max(sign * factor * (1.0 - sign * within), sign * other)
        outside = factor * (1.0 + sign * within)
        contradictory = outside < family.lowest
        try:
            conflict = None if contradictory else _conflict(family.at(outside), synthesizer)
            held = _conflict(family.at(inside), synthesizer) is None
        except SolverError:  # Too close to the border to decide.
            continue
        if held and (contradictory or conflict is not None):
            return Change(kind, ChangeOutcome.BOUND, factor, within, conflict)
    return Change(kind, ChangeOutcome.BOUND, factor, math.inf, conflict)


def _conflict(problem: Problem, synthesizer: Synthesizer) -> Certificate | None:
    """Return the certificate of an infeasible problem; None for a feasible one."""
    try:
        synthesizer.solve(problem)
    except InfeasibleError as error:
        return error.certificate
    return None
