r"""How much uncertainty one grip can bear: the largest factor on the set with which forces exist.

The sets of a smaller factor lie within those of a larger one (:meth:`UncertaintySet.scaled`), and a
grip that serves a set serves every part of it, so that the feasible factors are an interval from 0
up, whose end is bisected. Friction multiplies forces; the end is no optimum of one conic program.
Contact places, whose sets are not exactly convex, may blur it in the second order of their offset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fulcrum.synthesis import Problem, SolverError
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.robust.certificate import RobustCertificate, RobustInfeasibleError
from fulcrum.synthesis.robust.grip import RobustGrip, robust_grip
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet

# The last interval of the bisection, relative to where it starts: below any set's own precision.
_BISECTED = 1e-3
# How near to the factor at which nothing is left of mass or friction is tried, relative.
_SHARE_LEFT = 1e-3


@dataclass(frozen=True, eq=False)
class Scaling:
    """The largest scaling of a set of uncertainties that one grip serves.

    Attributes:
        factor: For which the grip is verified in every world [-].
        infeasible_from: Above it, the least factor that was proven infeasible [-]; infinite if the
            largest that was tried is feasible.
        grip: For ``factor``.
        certificate: Proof for ``infeasible_from``, which says what limits; None if infinite.
    """

    factor: float
    infeasible_from: float
    grip: RobustGrip
    certificate: RobustCertificate | None


def largest_scaling(
    problem: Problem, gravity: Gravity, uncertainty: UncertaintySet, most: float = 4.0
) -> Scaling:
    """Bisects the factor between 0 and ``most``; what the solver cannot decide is not borne.

    Args:
        problem: The nominal world.
        gravity: The weight, which its external wrench contains.
        uncertainty: The set whose factor is 1.
        most: The largest factor to try [-]; it is lowered to keep some mass and friction.

    Raises:
        InvalidInputError: The problem's objective is no function of the hands' normal forces.
        RobustInfeasibleError: Even the nominal world is infeasible.
        SolverError: The solver could not decide about the nominal world.
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
