r"""The unknown properties of object and contacts, as a set of worlds that one grip must serve.

The external wrench of (17) is that of the weight W along the unit vector g at the centre of mass c,
plus that of a push f at a point r:

.. math:: w_{ext} = W\,(g,\ c \times g) + (f,\ r \times f)

Both terms range over convex hulls of few wrenches. W and each component of c range over intervals,
and the first term is linear in each of them alone. So it is extreme at their corners, except those
within the hull of the others (moving c along g has no effect). Pushes are extreme along one of the
object's axes, at the farthest point along another. Worlds with every sum of the two, and the lowest
friction, represent all worlds in between (:mod:`synthesis.robust.grip`).

A hand that touches at an offset d adds the moment :math:`f_n\, d \times n` of its normal force
n f_n. Of all combinations of the hands' offsets along their tangents, those with extreme moments
for equal normal forces are used. With the much smaller moments of the tangential forces the set is
not exactly convex.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from fulcrum.synthesis import Contact, InvalidInputError, Problem
from fulcrum.synthesis.arrays import Array, Indices, N, Vector
from fulcrum.synthesis.contact import skew
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.settings import Fraction, Key, NotNegative, Settings, Spread3

# Points of a hull that differ by less than this share of its size are equal up to rounding.
_SAME = 1e-9


@dataclass(frozen=True)
class UncertaintySet(Settings):
    """The largest deviations of the worlds from the nominal world.

    Raises:
        InvalidInputError: A field is negative or not finite, or a share is not below 1.
    """

    mass: Fraction = 0.0
    """Share by which the mass may be lower or higher [-]."""

    center: Annotated[Spread3, Key("center_m")] = (0.0, 0.0, 0.0)
    """Offset of the centre of mass along each of the object's axes, either way [m]."""

    friction: Fraction = 0.0
    """Share by which friction may be lower [-]."""

    push: Annotated[Spread3, Key("push_n")] = (0.0, 0.0, 0.0)
    """Largest push along each of the object's axes, either way [N]; those between are within the
    hull of these. Pushes of up to P in any direction are within if each is sqrt(3) P."""

    lever: Annotated[Spread3, Key("lever_m")] = (0.0, 0.0, 0.0)
    """How far from the nominal centre of mass pushes act, along the object's axes [m]."""

    placement: Annotated[NotNegative, Key("placement_m")] = 0.0
    """Distance by which hands may miss their contacts along each tangent, either way [m]."""

    @property
    def label(self) -> str:
        """Return the name of the set in errors."""
        return "uncertainty"

    @property
    def largest_factor(self) -> float:
        """Return the factor at which a share would reach 1; infinite without shares."""
        share = max(self.mass, self.friction)
        return 1.0 / share if share > 0.0 else math.inf

    def scaled(self, factor: float) -> UncertaintySet:
        """Return the set with all offsets, shares and pushes multiplied; the lever does not change.

        Raises:
            InvalidInputError: The factor is not in [0, largest_factor).
        """
        if not 0.0 <= factor < self.largest_factor:
            raise InvalidInputError("factor", factor, f"in [0, {self.largest_factor:g})")
        return UncertaintySet(
            mass=factor * self.mass,
            center=_times(factor, self.center),
            friction=factor * self.friction,
            push=_times(factor, self.push),
            lever=self.lever,
            placement=factor * self.placement,
        )

    def worlds(self, problem: Problem, gravity: Gravity) -> tuple[Problem, ...]:
        """Return the worlds that represent the whole set.

        Args:
            problem: The nominal world.
            gravity: The weight, which is part of its external wrench.
        """
        w_rest = problem.w_ext_O - gravity.wrench_O
        wrenches = list(itertools.product(self._weights(gravity), self._pushes(gravity)))
        return tuple(
            replace(world, w_ext_O=w_rest + w_weight + w_push)
            for world in self.placed(problem)
            for w_weight, w_push in wrenches
        )

    def placed(self, problem: Problem) -> tuple[Problem, ...]:
        """Return the problem with the lowest friction and the hands at each extreme place.

        The number of places is the same for all problems with the same contacts on the object.
        """
        contacts = tuple(
            replace(c, mu=(1.0 - self.friction) * c.mu) if c.model.has_friction else c
            for c in problem.contacts
        )
        return tuple(self._displaced(problem, contacts, d_C) for d_C in self._offsets(problem))

    def _weights(self, gravity: Gravity) -> Array:
        """Return the extreme wrenches of the weight in the object frame, (k, 6)."""
        corners = itertools.product((1.0 - self.mass, 1.0 + self.mass), *[(-1.0, 1.0)] * 3)
        wrenches = []
        for share, *signs in corners:
            center_O = gravity.center_O + np.array(self.center) * signs
            weight = share * gravity.weight
            wrenches.append(replace(gravity, weight=weight, center_O=center_O).wrench_O)
        return _extreme(np.array(wrenches))

    def _pushes(self, gravity: Gravity) -> Array:
        """Return the extreme wrenches of pushes in the object frame, (k, 6)."""
        pushes = []
        largest, levers = np.diag(self.push), np.diag(self.lever)
        for k, sign in itertools.product(range(3), (-1.0, 1.0)):
            f = sign * largest[k]
            for j, side in itertools.product({0, 1, 2} - {k}, (-1.0, 1.0)):
                r = gravity.center_O + side * levers[j]
                pushes.append(np.concatenate([f, np.cross(r, f)]))
        return _extreme(np.array(pushes))

    def _offsets(self, problem: Problem) -> Array:
        """Return the extreme offsets of the n hand contacts, in their axes [m], (k, n, 3)."""
        hands = len(problem.hands)
        if not self.placement:
            return np.zeros((1, hands, 3))
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=2 * hands)))
        d_C = np.zeros((len(signs), hands, 3))
        d_C[:, :, :2] = self.placement * signs.reshape(-1, hands, 2)
        # d x n in the contact's axes is (d_o, -d_t, 0).
        moments = np.stack([d_C[..., 1], -d_C[..., 0], d_C[..., N]], axis=-1)
        R_OC = problem.R_OC[list(problem.hands)]
        return d_C[_extreme_rows(np.einsum("hij,khj->ki", R_OC, moments))]

    @staticmethod
    def _displaced(problem: Problem, contacts: tuple[Contact, ...], d_C: Array) -> Problem:
        """Return the world with other friction and the hand contacts moved by d_C [m], (n, 3)."""
        hands, joints = list(problem.hands), problem.joints
        p_OC_O = problem.p_OC_O.copy()
        p_OC_O[hands] += np.einsum("hij,hj->hi", problem.R_OC[hands], d_C)
        if joints is not None:
            # A point at the offset d from a contact moves with v + omega x d.
            J_C = joints.J_C.copy()
            J_C[:, :3] -= skew(d_C) @ J_C[:, 3:]
            joints = replace(joints, J_C=J_C)
        return replace(problem, contacts=contacts, p_OC_O=p_OC_O, joints=joints)


def _times(factor: float, vector: Vector) -> Vector:
    x, y, z = vector
    return factor * x, factor * y, factor * z


def _extreme(points: Array) -> Array:
    return points[_extreme_rows(points)]


def _extreme_rows(points: Array) -> Indices:
    """Return the indices of the points, (k, d), that span the convex hull of all."""
    centred = points - points.mean(axis=0)
    size = np.abs(points).max()
    _, first = np.unique(np.round(centred / (_SAME * size or 1.0)), axis=0, return_index=True)
    centred = centred[first]
    _, lengths, axes = np.linalg.svd(centred, full_matrices=False)
    rank = int((lengths > _SAME * size * len(points)).sum())
    if rank == 0:
        return first[:1]
    coordinates = centred @ axes[:rank].T
    if rank == 1:
        ends = [coordinates[:, 0].argmin(), coordinates[:, 0].argmax()]
        return first[ends]
    try:
        return first[np.sort(ConvexHull(coordinates).vertices)]
    except QhullError:  # The hull is almost flat, so its facets are rounding; keep all points.
        return first
