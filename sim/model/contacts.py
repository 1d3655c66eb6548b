"""Contacts of the scenario for synthesis and monitor: parameters and frames."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import read_mesh
from fulcrum.sim.scenario import Control, Friction, Scenario
from fulcrum.synthesis import Contact, ContactModel, InvalidInputError, Role
from fulcrum.synthesis.arrays import Array, Vector

# Largest depth of a contact inside its mesh's convex hull, which is what MuJoCo touches [m].
_INSIDE_HULL = 0.001


def contacts(scenario: Scenario, control: Control) -> tuple[Contact, ...]:
    """Return the contacts for the synthesis: friction scaled down, hands preloaded."""
    hands = tuple(
        _contact(h.name, Role.HAND, h.friction, control.friction_factor, control.preload, h.f_n_max)
        for h in scenario.hands
    )
    supports = tuple(
        _contact(s.name, Role.ENVIRONMENT, s.friction, control.friction_factor, 0.0, math.inf)
        for s in scenario.supports
    )
    return hands + supports


def true_contacts(scenario: Scenario) -> tuple[Contact, ...]:
    """Return the contacts by which the plant is judged: full friction, no preload."""
    return contacts(scenario, Control(friction_factor=1.0, preload=0.0))


def shared_places(scenario: Scenario) -> tuple[tuple[int, ...], ...]:
    """Return groups of indices of supports that hold the same point of the object.

    Statics does not determine how two surfaces share the force at a point.
    """
    points = [support.p_OP_O for support in scenario.supports]
    first = len(scenario.hands)
    places = [
        tuple(first + i for i, point in enumerate(points) if point == place)
        for place in dict.fromkeys(points)
    ]
    return tuple(place for place in places if len(place) > 1)


def _contact(
    name: str, role: Role, friction: Friction, factor: float, preload: float, f_n_max: float
) -> Contact:
    model = ContactModel.PCWF if friction.e_n is None else ContactModel.SFCE
    return Contact(
        name=name,
        role=role,
        model=model,
        mu=factor * friction.mu,
        e_n=friction.e_n or 1.0,
        f_n_min=preload,
        f_n_max=f_n_max,
    )


class ContactFrames:
    """Contact frames of a scenario, hands first: axes (t, o, n) with n into the object.

    Hand contacts are fixed in the object; at supports the point is fixed in the object and the
    axes in the world.

    Attributes:
        p_OC_O: Contact points in the object frame [m], (m, 3).
    """

    def __init__(self, scenario: Scenario) -> None:
        hands, supports = scenario.hands, scenario.supports
        self._R_OC = _stack([contact_axes(h.normal_O, h.tangent_O) for h in hands])
        self._R_WP = _stack([contact_axes(s.normal_W, s.tangent_W) for s in supports])
        self.p_OC_O = np.array([h.p_OC_O for h in hands] + [s.p_OP_O for s in supports])

    def in_world(self, R_WO: Array) -> Array:
        """Return the contact axes in the world, (..., m, 3, 3), at orientations, (..., 3, 3)."""
        hands = R_WO[..., None, :, :] @ self._R_OC
        supports = np.broadcast_to(self._R_WP, (*R_WO.shape[:-2], *self._R_WP.shape))
        return np.concatenate([hands, supports], axis=-3)

    def in_object(self, R_WO: Array) -> Array:
        """Return the contact axes in object axes, (m, 3, 3), at an orientation, (3, 3)."""
        return np.concatenate([self._R_OC, R_WO.T @ self._R_WP])

    def points(self, R_WO: Array, p_WO: Array) -> Array:
        """Return the contact points in the world [m], (m, 3), at a pose of the object."""
        return p_WO + self.p_OC_O.dot(R_WO.T)


def rotations(quaternions: Array) -> Array:
    """Return the rotation matrices, (..., 3, 3), of quaternions wxyz, (..., 4)."""
    flat = Rotation.from_quat(quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    return flat.reshape(*quaternions.shape[:-1], 3, 3)


def contact_axes(normal: Vector, tangent: Vector) -> Array:
    """Return the axes (t, o, n) of a contact as columns, (3, 3), from its normal and tangent."""
    n, t = np.asarray(normal, float), np.asarray(tangent, float)
    return np.column_stack([t, np.cross(n, t), n])


def across(vector: Array, normal: Array) -> Array:
    """Return the unit vector along the part of a vector normal to a unit normal, (3,) each."""
    part = vector - vector.dot(normal) * normal
    return part / np.linalg.norm(part)


def _stack(matrices: list[Array]) -> Array:
    return np.array(matrices).reshape(-1, 3, 3)


def check_contacts(scenario: Scenario) -> None:
    """Refuse contacts in the hollows of a mesh, which are closed by MuJoCo's convex hull.

    Raises:
        InvalidInputError: A contact is more than a millimetre inside the convex hull of its geom,
            or a mesh cannot be read.
    """
    geoms = {geom.name: geom for geom in scenario.object.geoms}
    placed = [(f"{hand.name}.p_OC_O", hand.geom, hand.p_OC_O) for hand in scenario.hands]
    placed += [(f"{s.name}.p_OP_O", s.geom, s.p_OP_O) for s in scenario.supports]
    for field, name, place in placed:
        geom = geoms[name]
        if geom.file is None:
            continue
        p_G = geom.pose.in_frame(place)
        depth = read_mesh(f"{name}.file", geom.file, geom.size).inside_hull(p_G)
        if depth > _INSIDE_HULL:
            valid = f"at most {1e3 * _INSIDE_HULL:g} mm inside the convex hull of {name}, which is "
            valid += f"what touches: it is {1e3 * depth:.1f} mm inside"
            raise InvalidInputError(field, place, valid)
