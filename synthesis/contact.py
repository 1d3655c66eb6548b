"""Contact models and the grasp map: what a contact can transmit, and where it acts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import InvalidInputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Positions of the components in a contact wrench (f_t, f_o, f_n, m_t, m_o, m_n).
T, O, N, M_N = 0, 1, 2, 5


class ContactModel(StrEnum):
    """Which components of the wrench a contact transmits."""

    FRICTIONLESS = "frictionless"
    PCWF = "point-contact-with-friction"
    SFCE = "soft-finger-elliptic"

    @property
    def components(self) -> tuple[int, ...]:
        """Transmitted components, the normal force first, as the friction cone orders them."""
        return _COMPONENTS[self]


_COMPONENTS = {
    ContactModel.FRICTIONLESS: (N,),
    ContactModel.PCWF: (N, T, O),
    ContactModel.SFCE: (N, T, O, M_N),
}


class Role(StrEnum):
    """Who pushes on the object: a hand, whose force costs joint torque, or the environment."""

    HAND = "hand"
    ENVIRONMENT = "environment"


@dataclass(frozen=True)
class Contact:
    r"""A contact's model and parameters; its friction cone, (1) to (4) of the paper, is

    .. math:: \sqrt{(f_t/e_t)^2 + (f_o/e_o)^2 + (m_n/e_n)^2} \le \mu f_n

    with :math:`m_n = 0` for PCWF and only :math:`f_n \ge 0` for a frictionless contact.

    Attributes:
        name: Unique within a problem.
        role: Hand or environment.
        model: What is transmitted.
        mu: Friction coefficient [-], > 0; unused by a frictionless contact.
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
        for field in () if self.model is ContactModel.FRICTIONLESS else ("mu", "e_t", "e_o", "e_n"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value > 0.0):
                remedy = "a finite number > 0"
                if field == "mu":
                    remedy += f" (without friction: model {ContactModel.FRICTIONLESS})"
                raise InvalidInputError(f"contact {self.name}.{field}", value, remedy)
        if not (math.isfinite(self.f_n_min) and self.f_n_min >= 0.0):
            raise InvalidInputError(
                f"contact {self.name}.f_n_min", self.f_n_min, "a finite number >= 0"
            )
        if not self.f_n_max >= self.f_n_min:
            raise InvalidInputError(
                f"contact {self.name}.f_n_max", self.f_n_max, f"at least f_n_min = {self.f_n_min}"
            )

    @cached_property
    def scale(self) -> Array:
        """Scale of each transmitted component, (k,): the cone is ||f[1:]/scale[1:]|| <= f[0]."""
        all_components = {
            T: self.mu * self.e_t,
            O: self.mu * self.e_o,
            N: 1.0,
            M_N: self.mu * self.e_n,
        }
        return np.array([all_components[c] for c in self.model.components])


def skew(p: Array) -> Array:
    """Cross-product matrices S(p) of vectors p, (..., 3) -> (..., 3, 3), with S(p) z = p x z."""
    S = np.zeros((*p.shape[:-1], 3, 3))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -p[..., 2], p[..., 1], -p[..., 0]
    S[..., 1, 0], S[..., 2, 0], S[..., 2, 1] = p[..., 2], -p[..., 1], p[..., 0]
    return S


def grasp_maps(R_OC: Array, p_OC_O: Array) -> Array:
    """Maps of contact wrenches to object wrenches, (8) and (9) of the paper.

    Args:
        R_OC: Contact axes (t, o, n) in the object's axes, (m, 3, 3).
        p_OC_O: Contact positions in the object frame [m], (m, 3).

    Returns:
        G, (m, 6, 6): ``w_O = G[i] @ w_C`` for contact i, linear part first.
    """
    G = np.zeros((len(R_OC), 6, 6))
    G[:, :3, :3] = R_OC
    G[:, 3:, :3] = skew(p_OC_O) @ R_OC
    G[:, 3:, 3:] = R_OC
    return G


def utilisation(contacts: tuple[Contact, ...], w_OC_C: Array) -> Array:
    """Friction utilisation of each contact: 0 along the normal, 1 on the cone, above 1 outside.

    Args:
        contacts: The m contacts.
        w_OC_C: Wrenches on the object in contact axes [N, N·m], (..., m, 6).

    Returns:
        (..., m); 0 where the contact is unloaded or frictionless, infinite for a tangential force
        without a normal force.
    """
    inverse = np.zeros((len(contacts), 6))
    for i, contact in enumerate(contacts):
        inverse[i, list(contact.model.components[1:])] = 1.0 / contact.scale[1:]
    tangential = np.linalg.norm(w_OC_C * inverse, axis=-1)
    normal = np.maximum(w_OC_C[..., N], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(tangential == 0.0, 0.0, tangential / normal)
