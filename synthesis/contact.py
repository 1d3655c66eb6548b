"""Contact models and the grasp map: what a contact can transmit, and where it acts."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, lru_cache

import numpy as np

from fulcrum.synthesis.arrays import M_N, Array, Indices, N, O, T
from fulcrum.synthesis.checks import not_negative, positive
from fulcrum.synthesis.errors import InvalidInputError


class ContactModel(StrEnum):
    """The components of the wrench that a contact transmits."""

    FRICTIONLESS = "frictionless"
    PCWF = "point-contact-with-friction"
    SFCE = "soft-finger-elliptic"

    @property
    def components(self) -> tuple[int, ...]:
        """Return the transmitted components in the order of the friction cone, normal first."""
        return _COMPONENTS[self]

    @property
    def has_friction(self) -> bool:
        """Return whether tangential forces are transmitted."""
        return self is not ContactModel.FRICTIONLESS


_COMPONENTS = {
    ContactModel.FRICTIONLESS: (N,),
    ContactModel.PCWF: (N, T, O),
    ContactModel.SFCE: (N, T, O, M_N),
}


class Role(StrEnum):
    """What pushes on the object: a hand, whose force needs joint torque, or the environment."""

    HAND = "hand"
    ENVIRONMENT = "environment"


@dataclass(frozen=True)
class Contact:
    r"""Model and parameters of a contact. Its friction cone, (1) to (4) of the paper, is

    .. math:: \sqrt{(f_t/e_t)^2 + (f_o/e_o)^2 + (m_n/e_n)^2} \le \mu f_n

    with :math:`m_n = 0` for PCWF and only :math:`f_n \ge 0` for a frictionless contact.

    Attributes:
        name: Unique within a problem.
        role: Hand or environment.
        model: Which components are transmitted.
        mu: Friction coefficient [-], > 0; not used by a frictionless contact.
        e_t: Ellipticity along t [-], > 0.
        e_o: Ellipticity along o [-], > 0.
        e_n: Ratio of torsional to tangential friction [m], > 0 (soft finger only).
        f_n_min: Preload, the lower bound of the normal force [N], >= 0.
        f_n_max: Upper bound of the normal force [N], (7) of the paper; may be infinite.

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    name: str
    role: Role
    model: ContactModel
    mu: float = 0.0
    e_t: float = 1.0
    e_o: float = 1.0
    e_n: float = 1.0
    f_n_min: float = 0.0
    f_n_max: float = math.inf

    def __post_init__(self) -> None:
        if not self.name:
            raise InvalidInputError("contact.name", repr(self.name), "a non-empty name")
        label = f"contact {self.name}"
        if self.model.has_friction:
            if not (math.isfinite(self.mu) and self.mu > 0.0):
                valid = f"a finite number > 0 (without friction: model {ContactModel.FRICTIONLESS})"
                raise InvalidInputError(f"{label}.mu", self.mu, valid)
            for field in ("e_t", "e_o", "e_n"):
                positive(f"{label}.{field}", getattr(self, field))
        not_negative(f"{label}.f_n_min", self.f_n_min)
        if not self.f_n_max >= self.f_n_min:
            valid = f"at least f_n_min = {self.f_n_min}"
            raise InvalidInputError(f"{label}.f_n_max", self.f_n_max, valid)

    @cached_property
    def scale(self) -> Array:
        """Return scales of the transmitted components, (k,): ||f[1:]/scale[1:]|| <= f[0]."""
        scales = {T: self.mu * self.e_t, O: self.mu * self.e_o, N: 1.0, M_N: self.mu * self.e_n}
        return np.array([scales[c] for c in self.model.components])


class ContactSet:
    """The parameters of a tuple of m contacts as arrays.

    Attributes:
        hands: Indices of the hand contacts, in order.
        hand_rows: The same as an index into arrays with one row per contact; a slice if possible.
        rough: Whether each contact has friction, (m,).
        widths: Number of transmitted components of each contact.
        starts: First position of each contact's components in the (k,) arrays below, (m + 1,).
        flat: Positions of all transmitted components in flattened (m, 6) wrenches, (k,).
        scale: Their scales, as in :attr:`Contact.scale`, (k,).
        reciprocal: 1 / scale; zero for components that are not transmitted, (m, 6).
        transmitted: 1 for transmitted components, else 0, (m, 6).
        friction: 1 / scale of the tangential components; zero for all others, (m, 6).
        f_n_min, f_n_max: Bounds of the normal forces [N], (m,).
        bounds: Right-hand sides of -f_n <= -f_n_min and f_n <= f_n_max [N], (2 m,).
        preload: The largest f_n_min [N].
        largest_bound: The largest finite bound [N].
        structure: Equal for two sets whose problems differ in numbers only.

    Raises:
        InvalidInputError: There are no contacts, or two of the same name.
    """

    def __init__(self, contacts: tuple[Contact, ...]) -> None:
        check_names("contacts", tuple(c.name for c in contacts))
        self.hands = tuple(i for i, c in enumerate(contacts) if c.role is Role.HAND)
        in_order = self.hands == tuple(range(len(self.hands)))
        self.hand_rows: slice | list[int] = slice(len(self.hands)) if in_order else list(self.hands)
        self.rough = np.array([c.model.has_friction for c in contacts])
        self.widths = tuple(len(c.model.components) for c in contacts)
        self.starts: Indices = np.cumsum([0, *self.widths])
        self.flat = np.concatenate(
            [6 * i + np.array(c.model.components) for i, c in enumerate(contacts)]
        )
        self.scale = np.concatenate([c.scale for c in contacts])
        self.reciprocal = np.zeros((len(contacts), 6))
        self.reciprocal.flat[self.flat] = 1.0 / self.scale
        self.transmitted = (self.reciprocal > 0.0).astype(float)
        self.friction = self.reciprocal.copy()
        self.friction[:, N] = 0.0
        self.f_n_min = np.array([c.f_n_min for c in contacts])
        self.f_n_max = np.array([c.f_n_max for c in contacts])
        self.preload = float(self.f_n_min.max())
        self.bounds = np.concatenate([-self.f_n_min, self.f_n_max])
        self.largest_bound = float(np.abs(self.bounds[np.isfinite(self.bounds)]).max())
        # One string, because Python keeps the hash of a string.
        self.structure = " ".join(
            f"{c.model}|{c.role}|{c.f_n_min > 0.0}|{math.isfinite(c.f_n_max)}" for c in contacts
        )

    @staticmethod
    def of(contacts: tuple[Contact, ...]) -> ContactSet:
        """Return the set of a tuple; it is made once for the one tuple of contacts of a run."""
        return _contact_set(_Same(contacts))


class _Same:
    """A key that compares a tuple by identity: contacts are frozen, but slow to hash."""

    __slots__ = ("contacts",)

    def __init__(self, contacts: tuple[Contact, ...]) -> None:
        self.contacts = contacts

    def __hash__(self) -> int:
        return id(self.contacts)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.contacts is other.contacts


@lru_cache(maxsize=64)
def _contact_set(key: _Same) -> ContactSet:
    return ContactSet(key.contacts)


def check_names(field: str, names: tuple[str, ...]) -> None:
    """Raise InvalidInputError if there are no names, or if a name occurs more than once."""
    if not names:
        raise InvalidInputError(field, "an empty set", "at least one")
    if len(set(names)) < len(names):
        repeated = sorted(name for name, count in Counter(names).items() if count > 1)
        raise InvalidInputError(field, f"{', '.join(repeated)} more than once", "unique names")


# S(p) is linear in p: row k holds S(e_k), flattened.
_SKEW = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]],
    dtype=np.float64,
)


def skew(p: Array) -> Array:
    """Return the cross-product matrices S(p), (..., 3, 3), of p, (..., 3): S(p) z = p x z."""
    return p.dot(_SKEW).reshape(*p.shape, 3)


def grasp_maps(R_OC: Array, p_OC_O: Array) -> Array:
    """Return the maps of contact wrenches to object wrenches, (8) and (9) of the paper.

    Args:
        R_OC: Contact axes (t, o, n) in the object's axes, (m, 3, 3).
        p_OC_O: Contact positions in the object frame [m], (m, 3).

    Returns:
        G, (m, 6, 6): ``w_O = G[i] @ w_C`` for contact i, linear part first.
    """
    G = np.zeros((len(R_OC), 6, 6))
    G[:, :3, :3] = R_OC
    np.matmul(skew(p_OC_O), R_OC, out=G[:, 3:, :3])
    G[:, 3:, 3:] = R_OC
    return G


def utilisation(contacts: tuple[Contact, ...], w_OC_C: Array) -> Array:
    """Return the friction utilisation of each contact: 0 on the normal, 1 on the cone's surface.

    Args:
        contacts: The m contacts.
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (..., m, 6).

    Returns:
        (..., m); 0 where the contact is unloaded or frictionless, infinite for a tangential force
        without a normal force.
    """
    tangential = np.linalg.norm(w_OC_C * ContactSet.of(contacts).friction, axis=-1)
    normal = np.maximum(w_OC_C[..., N], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(tangential == 0.0, 0.0, tangential / normal)
