r"""What is not known of object and contacts, as a set of worlds that one grip has to serve.

The external wrench of (17) is that of the weight W along the unit vector g at the centre of mass c,
plus that of a push f at a point r:

.. math:: w_{ext} = W\,(g,\ c \times g) + (f,\ r \times f)

Both terms range over convex hulls of few wrenches. W and each component of c range over intervals,
and the first term is linear in each of them alone; so it is extreme at their corners, less those
within the hull of the others (moving c along g does nothing). Pushes are extreme along one of the
object's axes, at the point farthest off along another. Worlds with every sum of the two, and the
lowest friction, stand for all in between (:mod:`synthesis.robust.grip`).

A hand that touches elsewhere multiplies forces by its offset d. The moment of its normal force
n f_n is :math:`f_n\, d \times n`; of all combinations of the hands' offsets along their tangents
those are taken whose moments are extreme for equal normal forces. The much smaller moments of the
tangential forces make no set that is exactly convex.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from fulcrum.synthesis import Contact, ContactModel, InvalidInputError, Joints, Problem
from fulcrum.synthesis.arrays import Array, Indices, N, Vector
from fulcrum.synthesis.contact import skew
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.settings import Fraction, Key, NotNegative, Settings, Spread3

# Points of a hull that differ by less than this share of its size are one: rounding, and no more.
_SAME = 1e-9


@dataclass(frozen=True)
class UncertaintySet(Settings):
    """By how much the worlds may differ from the nominal one.

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
        """What errors call the set."""
        return "uncertainty"

    @property
    def largest_factor(self) -> float:
        """The factor at which a share would reach 1; infinite without shares."""
        share = max(self.mass, self.friction)
        return 1.0 / share if share > 0.0 else math.inf

    def scaled(self, factor: float) -> UncertaintySet:
        """The set with all offsets, shares and pushes multiplied; where pushes act stays.

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
        """The worlds that stand for all of the set.

        Args:
            problem: The nominal world.
            gravity: The weight, which its external wrench contains.
        """
        w_rest = problem.w_ext_O - gravity.wrench_O
        wrenches = itertools.product(
            self.placed(problem), self._weights(gravity), self._pushes(gravity)
        )
        return tuple(
            replace(world, w_ext_O=w_rest + w_weight + w_push)
            for world, w_weight, w_push in wrenches
        )

    def placed(self, problem: Problem) -> tuple[Problem, ...]:
        """The problem with the lowest friction, and with the hands at each of their extreme places.

        They are as many for all problems whose contacts are fixed in the object alike.
        """
        contacts = tuple(self._slippery(contact) for contact in problem.contacts)
        return tuple(self._displaced(problem, contacts, d_C) for d_C in self._offsets(problem))

    def _slippery(self, contact: Contact) -> Contact:
        if contact.model is ContactModel.FRICTIONLESS:
            return contact
        return replace(contact, mu=(1.0 - self.friction) * contact.mu)

    def _weights(self, gravity: Gravity) -> Array:
        """Extreme wrenches of the weight in the object frame, (k, 6)."""
        corners = itertools.product((1.0 - self.mass, 1.0 + self.mass), *[(-1.0, 1.0)] * 3)
        return _extreme(
            np.array(
                [
                    replace(
                        gravity,
                        weight=share * gravity.weight,
                        center_O=gravity.center_O + np.array(self.center) * signs,
                    ).wrench_O
                    for share, *signs in corners
                ]
            )
        )

    def _pushes(self, gravity: Gravity) -> Array:
        """Extreme wrenches of pushes in the object frame, (k, 6)."""
        pushes = []
        largest, levers = np.diag(self.push), np.diag(self.lever)
        for k, sign in itertools.product(range(3), (-1.0, 1.0)):
            f = sign * largest[k]
            for j, side in itertools.product({0, 1, 2} - {k}, (-1.0, 1.0)):
                r = gravity.center_O + side * levers[j]
                pushes.append(np.concatenate([f, np.cross(r, f)]))
        return _extreme(np.array(pushes))

    def _offsets(self, problem: Problem) -> Array:
        """Extreme offsets of the n hand contacts, in their axes [m], (k, n, 3)."""
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
        """The world with other friction and the hand contacts moved by d_C [m], (n, 3)."""
        hands, joints = list(problem.hands), problem.joints
        p_OC_O = problem.p_OC_O.copy()
        p_OC_O[hands] += np.einsum("hij,hj->hi", problem.R_OC[hands], d_C)
        return replace(
            problem,
            contacts=contacts,
            p_OC_O=p_OC_O,
            joints=None if joints is None else _at_offset(joints, d_C),
        )


def _times(factor: float, vector: Vector) -> Vector:
    x, y, z = vector
    return factor * x, factor * y, factor * z


def _at_offset(joints: Joints, d_C: Array) -> Joints:
    """The joints with the Jacobians of points at offsets d from the contacts: v + omega x d."""
    J_C = joints.J_C.copy()
    J_C[:, :3] -= skew(d_C) @ J_C[:, 3:]
    return replace(joints, J_C=J_C)


def _extreme(points: Array) -> Array:
    return points[_extreme_rows(points)]


def _extreme_rows(points: Array) -> Indices:
    """Indices of the points, (k, d), whose convex hull is that of all, in their affine span."""
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
    except QhullError:  # All but flat, its facets are rounding; with all points nothing is lost.
        return first
