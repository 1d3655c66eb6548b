"""Explanations: why no forces exist, what to change, or how much may change."""

from __future__ import annotations

import math

import numpy as np

from fulcrum.sim.analysis.explanation import RELAXED, Explanation, Influence, Optimum, Remedy
from fulcrum.sim.planning import PathProblems
from fulcrum.synthesis import InfeasibleError, Problem, Solution, Synthesizer
from fulcrum.synthesis.analysis import (
    UNITS,
    Change,
    ChangeOutcome,
    Conflict,
    Kind,
    and_list,
    changes,
    relaxed,
    sensitivities,
    tightest,
    weight_range,
)
from fulcrum.synthesis.analysis.conflict import conflict
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.problem import Gravity

# Steps of the scan for the tightest tilt [deg].
_SCAN_DEG = 5.0
# Relative distance to its limit below which a force, torque or utilisation counts as at it [-].
_ACTIVE = 1e-6


def tightest_tilt(problems: PathProblems, synthesizer: Synthesizer) -> float:
    """Return the first infeasible tilt of a scan, or the one that holds the least weight [deg]."""
    tilts = problems.tilts(_SCAN_DEG)
    heaviest = []
    for tilt in tilts:
        problem, gravity = problems.problem(tilt), problems.gravity(tilt)
        try:
            low, high = weight_range(problem, gravity, synthesizer)
        except InfeasibleError:
            return float(tilt)
        if not low <= gravity.weight <= high:
            return float(tilt)
        heaviest.append(high)
    if math.isinf(min(heaviest)):
        # Without limits any weight can be held: return the tilt with the largest objective.
        values = [synthesizer.solve(problems.problem(tilt)).value for tilt in tilts]
        return float(tilts[int(np.argmax(values))])
    return float(tilts[int(np.argmin(heaviest))])


def explain(problems: PathProblems, tilt_deg: float, synthesizer: Synthesizer) -> Explanation:
    """Explain the problem at a tilt [deg].

    Raises:
        InvalidInputError: The tilt is not on the path.
    """
    problem, gravity = problems.problem(tilt_deg), problems.gravity(tilt_deg)
    R_WO = problems.orientation(tilt_deg)
    found = changes(problem, gravity, synthesizer)
    why_not, optimum = None, None
    try:
        optimum = _optimum(synthesizer.solve(problem), gravity)
    except InfeasibleError as error:
        why_not = conflict(tightest(error.certificate, found), gravity, R_WO)
    scene = problems.scenario
    believed = {hand.name: hand.friction.mu for hand in scene.hands}
    believed |= {support.name: support.friction.mu for support in scene.supports}
    remedies = {}
    for kind, change in found.items():
        blocked = None
        if change.conflict is not None:
            blocked = conflict(change.conflict, gravity, R_WO)
        text = _words(change, problem, gravity, believed)
        remedies[kind] = Remedy(
            change.outcome, change.factor, change.confirmed_within, text, blocked
        )
    return Explanation(
        scenario=scene.name,
        object=scene.object.name,
        objective=problem.objective,
        tilt_deg=float(tilt_deg),
        weight=gravity.weight,
        feasible=optimum is not None,
        conflict=why_not,
        gains={} if why_not is None else _gains(problem, gravity, why_not, synthesizer),
        optimum=optimum,
        changes=remedies,
    )


def _gains(
    problem: Problem, gravity: Gravity, why_not: Conflict, synthesizer: Synthesizer
) -> dict[str, float]:
    try:
        _, before = weight_range(problem, gravity, synthesizer)
    except InfeasibleError:
        return {}
    if before == 0.0 or math.isinf(before):
        return {}
    return {
        name: weight_range(looser, gravity, synthesizer)[1] / before - 1.0
        for name, looser in relaxed(problem, RELAXED).items()
        if name in why_not.limits
    }


def _optimum(solution: Solution, gravity: Gravity) -> Optimum:
    problem = solution.problem
    slopes = sensitivities(solution, gravity)
    rows = [("weight", gravity.weight, "N", slopes.weight)]
    for c in problem.contacts:
        for what, value, unit, by_name in (
            ("friction", c.mu, "-", slopes.friction),
            ("preload", c.f_n_min, "N", slopes.f_n_min),
            ("grip limit", c.f_n_max, "N", slopes.f_n_max),
        ):
            if c.name in by_name:
                rows.append((f"{what} of {c.name}", value, unit, by_name[c.name]))
    joints = problem.joints
    for k, name in enumerate(joints.names if joints else ()):
        assert joints is not None
        for what, limits, s in (
            ("upper", joints.tau_max, slopes.tau_max),
            ("lower", joints.tau_min, slopes.tau_min),
        ):
            if name in s:
                rows.append((f"{what} torque limit of {name}", float(limits[k]), "N·m", s[name]))
    size = abs(solution.value) or 1.0
    return Optimum(
        value=solution.value,
        unit=UNITS[problem.objective],
        normal_forces={
            c.name: float(f) for c, f in zip(problem.contacts, solution.w_OC_C[:, N], strict=True)
        },
        active=_active(solution),
        sensitivities=slopes,
        influences={
            name: Influence(value, unit, slope, slope * value / size)
            for name, value, unit, slope in rows
            if abs(slope * value) > _ACTIVE * size
        },
    )


def _active(solution: Solution) -> tuple[str, ...]:
    problem, joints, active = solution.problem, solution.problem.joints, []
    f_n = solution.w_OC_C[:, N]
    unit = float(np.abs(solution.w_OC_C).max())
    for i, c in enumerate(problem.contacts):
        if f_n[i] <= _ACTIVE * unit:
            active.append(f"{c.name} unloaded")
        elif solution.utilisation[i] >= 1.0 - _ACTIVE:
            active.append(f"friction of {c.name}")
        if c.f_n_min > 0.0 and f_n[i] - c.f_n_min <= _ACTIVE * unit:
            active.append(f"preload of {c.name}")
        if c.f_n_max - f_n[i] <= _ACTIVE * unit:
            active.append(f"grip limit of {c.name}")
    for k, name in enumerate(joints.names if joints else ()):
        assert joints is not None
        margin = min(joints.tau_max[k] - solution.tau[k], solution.tau[k] - joints.tau_min[k])
        if margin <= _ACTIVE * unit:
            active.append(f"torque limit of {name}")
    return tuple(active)


def _words(change: Change, problem: Problem, gravity: Gravity, friction: dict[str, float]) -> str:
    """Return a change in a few words, with the resulting numbers: friction as the file says it."""
    kind, factor = change.kind, change.factor
    if change.outcome is ChangeOutcome.ABSENT:
        return f"there are no {kind}"
    if change.outcome is ChangeOutcome.NEVER:
        return {
            Kind.FRICTION: f"does not help, not even {factor:.4g} times as much friction",
            Kind.TORQUE: "does not help, not even without torque limits",
            Kind.WEIGHT: "does not help, not even without weight",
            Kind.GRIP: "does not help, not even without grip limits",
        }[kind]
    if change.outcome is ChangeOutcome.ALWAYS:
        if kind is Kind.WEIGHT:
            return "any weight"
        return f"by a factor of {factor:.3g} or less" if factor else "to any value, even 0"
    # An infeasible problem needs more friction, torque or grip, or less weight; a feasible one
    # allows for the opposite.
    needed = (factor > 1.0) is (kind is not Kind.WEIGHT)
    more, less = ("to at least", "to at most") if needed else ("up to", "down to")
    text = f"{more if factor > 1.0 else less} {factor:.4g} times"
    if kind is Kind.WEIGHT:
        text += f" ({factor * gravity.weight:.4g} N)"
    elif kind is Kind.FRICTION:
        text += _numbers({c.name: factor * friction[c.name] for c in problem.contacts}, "")
    elif kind is Kind.GRIP:
        text += _numbers({c.name: factor * c.f_n_max for c in problem.contacts}, " N")
    return text if math.isfinite(change.confirmed_within) else f"{text} (not confirmed)"


def _numbers(values: dict[str, float], unit: str) -> str:
    """Return the names with their values as text, names with equal values together."""
    names: dict[str, list[str]] = {}
    for name, value in values.items():
        if math.isfinite(value):
            names.setdefault(f"{value:.4g}{unit}", []).append(name)
    return f" ({'; '.join(f'{value} at {and_list(owners)}' for value, owners in names.items())})"
