r"""The largest factor on a set of uncertainties for which one grip exists.

The set of a smaller factor is part of that of a larger one (:meth:`UncertaintySet.scaled`), and a
grip that serves a set serves every part of it. So the feasible factors are an interval from 0 up,
whose end is bisected: friction multiplies forces, so it is not the optimum of one conic program.
Sets of contact places are not exactly convex, with an error of second order in their offset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fulcrum.synthesis import Problem, SolverError
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.robust.certificate import RobustCertificate, RobustInfeasibleError
from fulcrum.synthesis.robust.grip import RobustGrip, robust_grip
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet

# Last interval of the bisection, relative to the first: less than the precision of any set.
_BISECTED = 1e-3
# Relative distance from the factor at which no mass or friction is left.
_SHARE_LEFT = 1e-3


@dataclass(frozen=True, eq=False)
class Scaling:
    """The largest scaling of a set of uncertainties that one grip serves.

    Attributes:
        factor: Factor for which the grip is verified in every world [-].
        infeasible_from: Least factor that was proven infeasible [-]; infinite if the largest tried
            factor is feasible.
        grip: Grip for ``factor``.
        certificate: Proof for ``infeasible_from``; None if that is infinite.
    """

    factor: float
    infeasible_from: float
    grip: RobustGrip
    certificate: RobustCertificate | None


def largest_scaling(
    problem: Problem, gravity: Gravity, uncertainty: UncertaintySet, most: float = 4.0
) -> Scaling:
    """Return the largest factor up to ``most``; undecided factors count as infeasible.

    Args:
        problem: The nominal world.
        gravity: The weight, which is part of its external wrench.
        uncertainty: The set with the factor 1.
        most: Largest factor to try [-]; lowered so that some mass and friction remain.

    Raises:
        InvalidInputError: The problem's objective is not a function of the hands' normal forces.
        RobustInfeasibleError: The nominal world is infeasible.
        SolverError: The solver could not decide whether the nominal world is feasible.
    """

    def attempt(factor: float) -> RobustGrip | RobustCertificate | None:
        try:
            return robust_grip(uncertainty.scaled(factor).worlds(problem, gravity))
        except RobustInfeasibleError as error:
            return error.certificate
        except SolverError:
            return None

    most = min(most, (1.0 - _SHARE_LEFT) * uncertainty.largest_factor)
    found = attempt(most)
    if isinstance(found, RobustGrip):
        return Scaling(most, math.inf, found, None)
    low, high = 0.0, most
    infeasible_from, certificate = (math.inf, None) if found is None else (most, found)
    grip = robust_grip(uncertainty.scaled(low).worlds(problem, gravity))
    while high - low > _BISECTED * most:
        middle = (low + high) / 2.0
        found = attempt(middle)
        if isinstance(found, RobustGrip):
            low, grip = middle, found
            continue
        high = middle
        if found is not None:
            infeasible_from, certificate = middle, found
    return Scaling(low, infeasible_from, grip, certificate)
