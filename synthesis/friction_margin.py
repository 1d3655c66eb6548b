r"""The friction margin: the smallest largest utilisation :math:`\|f_t\| / f_n` of all contacts.

An unloaded contact has no utilisation. Forces with utilisations up to s exist exactly if (17) with
its cones shrunk to :math:`\|f_t\| \le s f_n` is feasible. The set S(s) of such forces grows with s,
and the margin is the least s with S(s) not empty.

Dinkelbach's method for the largest of several ratios (Crouzeix, Ferland, Schaible 1985) finds it:
at the utilisation :math:`s` of the last forces solve

.. math:: \min \lambda \quad \text{s.t. (12), (15), (16), (7)},\quad
          \|f_{t,i}\| \le s f_{n,i} + \lambda d_i

with :math:`d_i` the last normal forces, starting from :math:`s = d_i = 1` with
:math:`\lambda \le 0`, which is feasible exactly if (17) is. A negative :math:`\lambda` gives
forces with a smaller utilisation; none is left when :math:`\lambda = 0`. The method converges
superlinearly, in 4 to 8 solves. For an unloaded contact, :math:`d_i = 0` keeps it within the cone
at s and does not limit the others.

The method can fail in two ways. Where hands and environment can squeeze the object without limit,
at utilisations from :math:`s_\infty` on, :math:`\lambda` has no bound for :math:`s > s_\infty`. And
it never unloads a contact, although without that contact s may be smaller. So its answer is
accepted only if S is empty just below it. If not, s is bisected, with the smallest forces in S(s):

.. math:: R(s) = \min_{F \in S(s)} \max_i f_{n,i}

R falls with s. For :math:`s < s_\infty` the set S(s) is compact, because a sequence of growing
forces in it would have a squeeze as its limit direction. So an infimum :math:`s^* < s_\infty` is
always attained. At :math:`s^* = s_\infty` it is attained exactly if R(s) stays finite as s falls to
it. If not, utilisations near it need forces that grow without limit, and there is no optimum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.contact import Role
from fulcrum.synthesis.errors import SolverError, UnboundedError
from fulcrum.synthesis.problem import Objective, Problem
from fulcrum.synthesis.solution import (
    Certificate,
    InfeasibleError,
    Multipliers,
    Solution,
    shrink_cones,
)

_TOLERANCE = 1e-9
_SOLVES = 50
# Normal forces below this fraction of the largest force count as zero: their cones are noise.
_LOADED = 1e-6
# Dinkelbach's answer is accepted if no utilisation is smaller by this share and number [-].
_BELOW = 1e-6, 1e-7
# Multipliers are a proof if their value is at most the first and the preloads' share in it at least
# the second; a smaller share is within the solver's noise [-].
_GAP, _PRELOADED = 1e-7, 1e-2
# Forces of more than this many times the load count as unlimited [-].
_FARTHEST = 1e4


@dataclass(frozen=True)
class Parameters:
    """Parameters of the friction-margin problem: utilisation s [-] and slack scales d, (m,)."""

    s: float = 1.0
    d: Array | None = None


AS_IT_STANDS = Parameters()
Solve = Callable[[Problem, Parameters], Solution]


def largest_margin(solve: Solve, problem: Problem) -> Solution:
    """Return forces whose largest utilisation is the smallest.

    Args:
        solve: Function that solves a problem with parameters, and returns lambda as the value.
        problem: Problem whose objective is the friction margin.

    Raises:
        InfeasibleError: No forces satisfy the constraints.
        UnboundedError: The least utilisation is approached only as forces grow without limit.
        SolverError: The solver found neither forces nor a proof.
    """
    search = _Search(solve, problem)
    try:
        found = _dinkelbach(solve, problem)
    except (UnboundedError, SolverError):
        return search.least(None)
    share, number = _BELOW
    below = (1.0 - share) * found.value - number
    if below <= 0.0 or _proven(found) or not search.serves(below):
        return found
    return search.least(found)


def _proven(found: Solution) -> bool:
    """Return whether the multipliers prove that S is empty below.

    For smaller cones they stay stationary if the reduction of each y_n is added to the multiplier
    of the contact's preload. The Lagrangian, 0 at s, then rises by the sum of y_n f_n_min, while
    the sum of y_n f_n is s.
    """
    if found.residuals.gap > _GAP:
        return False
    y_n = found.multipliers.cone[:, N]
    return bool(y_n @ found.problem.contact_set.f_n_min > _PRELOADED * found.value)


def _dinkelbach(solve: Solve, problem: Problem) -> Solution:
    """Apply Dinkelbach's method; every iterate is feasible, so stopping early only costs margin."""
    unit = problem.unit
    best = last = solve(problem, AS_IT_STANDS)
    iterations, solve_s = last.iterations, last.solve_s
    s, loaded = _largest_utilisation(last, unit)
    for _ in range(_SOLVES):
        if not loaded.any():
            break
        slack = np.where(loaded, last.w_OC_C[:, N], 0.0)
        try:
            last = solve(problem, Parameters(s=s, d=slack))
        except InfeasibleError:  # At s forces leave the cones by noise only.
            break
        iterations += last.iterations
        solve_s += last.solve_s
        before = loaded
        ratio, loaded = _largest_utilisation(last, unit)
        best = replace(last if ratio < s else best, unpack=last.unpack)
        stalled = ratio > s - _TOLERANCE and (loaded == before).all()
        if stalled or last.value > -_TOLERANCE:
            break
        s = min(s, ratio)
    else:
        raise SolverError(f"no convergence of the friction margin in {_SOLVES} solves")
    value, _ = _largest_utilisation(best, unit)
    return replace(best, value=value, iterations=iterations, solve_s=solve_s)


class _Search:
    """The bisection for the least utilisation, with its interval and best solution so far."""

    def __init__(self, solve: Solve, problem: Problem) -> None:
        self._solve, self._problem = solve, problem
        self._squeezed = _squeezed(problem)
        self._unit = problem.unit
        self._low, self._high = 0.0, 1.0
        self._best: Solution | None = None
        self._proof: Certificate | None = None
        # Whether the utilisation just below needs forces that count as unlimited.
        self._far = False
        self._iterations, self._solve_s = 0, 0.0

    def serves(self, s: float) -> bool:
        """Return whether forces with utilisations up to s exist, and narrow the interval."""
        try:
            found = self._solve(shrink_cones(self._squeezed, s), AS_IT_STANDS)
        except (InfeasibleError, SolverError) as error:
            self._low, self._far = s, False
            if isinstance(error, InfeasibleError):
                self._proof = error.certificate
            return False
        self._iterations += found.iterations
        self._solve_s += found.solve_s
        if found.value > _FARTHEST * self._unit:
            self._low, self._far = s, True
            return False
        self._high, self._best = s, found
        return True

    def least(self, known: Solution | None) -> Solution:
        """Return the forces with the least utilisation.

        Args:
            known: Solution of Dinkelbach's method, whose effort counts; None if it failed.
        """
        if self._best is None and not self.serves(1.0):
            if self._proof is not None:
                raise InfeasibleError(replace(self._proof, problem=self._problem))
            raise SolverError("no forces within the cones")
        self._low = 0.0
        if not self.serves(_TOLERANCE):
            while self._high - self._low > _TOLERANCE:
                self.serves(0.5 * (self._low + self._high))
        assert self._best is not None
        if self._far:
            raise UnboundedError(self._problem.objective, self._high)
        found = replace(self._best, problem=self._problem)
        value, _ = _largest_utilisation(found, self._unit)
        return replace(
            found,
            value=value,
            unpack=self._multipliers,
            iterations=self._iterations + (known.iterations if known else 0),
            solve_s=self._solve_s + (known.solve_s if known else 0.0),
        )

    def _multipliers(self) -> Multipliers:
        """Return the proof that a smaller utilisation has no forces, scaled to the forces' work."""
        assert self._best is not None
        if self._proof is None:  # No forces have a utilisation below 0.
            m, l = len(self._problem.contacts), self._best.tau.size
            sizes = (6, (m, 6), m, m, l, l, 0)
            return Multipliers(*(np.zeros(size) for size in sizes))
        ray = self._proof.multipliers
        return ray.over(float((ray.cone[:, N] * self._best.w_OC_C[:, N]).sum()) or 1.0)


def _squeezed(problem: Problem) -> Problem:
    """Return the problem whose optimum is the smallest largest normal force of all contacts."""
    joints = problem.joints
    if joints is not None:
        J_C = np.zeros((len(problem.contacts), *joints.J_C.shape[1:]))
        J_C[list(problem.hands)] = joints.J_C
        joints = replace(joints, J_C=J_C)
    return replace(
        problem,
        contacts=tuple(replace(contact, role=Role.HAND) for contact in problem.contacts),
        joints=joints,
        objective=Objective.MAX_NORMAL_FORCE,
    )


def _largest_utilisation(solution: Solution, unit: float) -> tuple[float, NDArray[np.bool_]]:
    """Return the largest utilisation of loaded contacts with friction, and their mask, (m,)."""
    f_n = solution.w_OC_C[:, N]
    loaded = f_n > _LOADED * max(unit, f_n.max())
    loaded &= solution.problem.contact_set.rough
    return float(solution.utilisation[loaded].max(initial=0.0)), loaded
