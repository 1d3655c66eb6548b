"""The contact force synthesis problem, (17) of the paper, as checked and frozen data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from operator import le

import numpy as np

from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.contact import Contact, ContactModel, ContactSet, check_names, grasp_maps
from fulcrum.synthesis.errors import InvalidInputError
from fulcrum.synthesis.markdown import number, numbers
from fulcrum.synthesis.render import Marked, Page, page, table, to_markdown

# Rotation matrices come from integrated quaternions: 1e-6 passes those, and nothing mis-scaled.
_ROTATION_TOLERANCE = 1e-6
# How near 1 a determinant has to be for the quick proof of a rotation.
_UNIT_DETERMINANT = 1e-2 * _ROTATION_TOLERANCE
_ORIGIN = np.zeros(3)
_ORIGIN.setflags(write=False)
# Moments are about the object frame's origin up to this distance from the contacts, in units of
# their spread [-]. On 60 random problems, forces then deviate by up to 1e-8, the solver's own
# tolerance; about origins farther away by 6e-7 at 250 spreads, by a quarter at 2500, and by all of
# their size at 25,000. About the middle they keep to 3e-8 at 1e6 m.
_NEAR = 10.0


class Objective(StrEnum):
    """What is minimised: the paper's four objectives, and two that limits and friction call for."""

    MAX_NORMAL_FORCE = "max-normal-force"
    NORM_NORMAL_FORCE = "norm-normal-force"
    MAX_TORQUE = "max-torque"
    NORM_TORQUE = "norm-torque"
    MAX_TORQUE_UTILISATION = "max-torque-utilisation"
    FRICTION_MARGIN = "friction-margin"

    @property
    def needs_joints(self) -> bool:
        """Whether the objective is a function of the joint torques."""
        return self in _TORQUE_OBJECTIVES


_TORQUE_OBJECTIVES = (
    Objective.MAX_TORQUE,
    Objective.NORM_TORQUE,
    Objective.MAX_TORQUE_UTILISATION,
)


@dataclass(frozen=True, eq=False)
class Joints:
    r"""The joints that make the hand contact forces, (13) to (16) of the paper.

    With :math:`f_C` the wrench on the object and :math:`\tau_g` the torque that holds the arm up
    (the generalised gravity), statics is :math:`\tau = J^T f_C + \tau_g`; the paper's (13) is the
    same with the signs of the torques flipped.

    Attributes:
        names: The l joints.
        J_C: Contact Jacobians, (n, 6, l), one per hand contact in the problem's order: the twist of
            the end effector's point at the contact in contact axes, linear part first. Joints
            shared by several contacts (a wrist) have columns in each of them.
        tau_g: Torque that balances gravity on the arm [N·m or N], (l,).
        tau_min: Lower torque limits [N·m or N], (l,); may be -inf.
        tau_max: Upper torque limits [N·m or N], (l,); may be inf.

    Raises:
        InvalidInputError: A field is non-finite, mis-shaped or contradictory.
    """

    names: tuple[str, ...]
    J_C: Array
    tau_g: Array
    tau_min: Array
    tau_max: Array

    def __post_init__(self) -> None:
        check_names("joints.names", self.names)
        joints = len(self.names)
        if self.J_C.ndim != 3 or self.J_C.shape[1:] != (6, joints):
            raise InvalidInputError("joints.J_C", f"shape {self.J_C.shape}", f"(n, 6, {joints})")
        _check_shape("joints.tau_g", self.tau_g, (joints,))
        _check_shape("joints.tau_min", self.tau_min, (joints,))
        _check_shape("joints.tau_max", self.tau_max, (joints,))
        _check_finite("joints.J_C", self.J_C)
        _check_finite("joints.tau_g", self.tau_g)
        low, high = self.tau_min.tolist(), self.tau_max.tolist()
        if not (all(map(le, low, high)) and max(low) < math.inf and min(high) > -math.inf):
            ordered = self.tau_min <= self.tau_max
            ordered &= (self.tau_min < np.inf) & (self.tau_max > -np.inf)
            worst = int(np.argmin(ordered))
            raise InvalidInputError(
                f"joints.tau_min[{self.names[worst]}]",
                self.tau_min[worst],
                f"below inf and no larger than tau_max = {self.tau_max[worst]} > -inf",
            )


@dataclass(frozen=True, eq=False)
class Problem:
    r"""Contact force synthesis for one pose of object and robot, (17) of the paper:

    .. math::

        \text{minimise}\quad   & \Phi(F_C, \tau) \\
        \text{subject to}\quad & G_C F_C + G_E F_E + w_{ext} = 0          && (12) \\
                               & \tau = J^T F_C + \tau_g                  && (15) \\
                               & \tau_{min} \le \tau \le \tau_{max}       && (16) \\
                               & F_{n,min} \le F_n \le F_{n,max}          && (7) \\
                               & f_i \in \mathcal{K}_i                    && (5), (6)

    Attributes:
        contacts: The m contacts with their models and parameters.
        R_OC: Contact axes (t, o, n) in the object's axes, n into the object, (m, 3, 3).
        p_OC_O: Contact positions in the object frame [m], (m, 3).
        w_ext_O: External wrench on the object, weight included, in the object frame [N, N·m], (6,).
        joints: The joints behind the hand contacts; None leaves (15) and (16) out.
        objective: Phi.
        contact_set: What follows from the contacts alone, as arrays; not to be given.
        p_OB_O: The point B that the moments of (12) are about, in the object frame [m], (3,): the
            frame's origin, or the middle of the contacts if the origin is so far away that
            equations about it lose digits; not to be given.
        G: Grasp maps of all contacts, with moments about B, (m, 6, 6); not to be given.
        w_ext_B: The external wrench with its moment about B [N, N·m], (6,); not to be given.
        load: The largest load: external wrench, preload and, if torque counts, gravity [N or N·m];
            not to be given.

    Raises:
        InvalidInputError: A field is non-finite, mis-shaped or senseless.
    """

    contacts: tuple[Contact, ...]
    R_OC: Array
    p_OC_O: Array
    w_ext_O: Array
    joints: Joints | None = None
    objective: Objective = Objective.MAX_NORMAL_FORCE
    contact_set: ContactSet = field(init=False, repr=False)
    p_OB_O: Array = field(init=False, repr=False)
    G: Array = field(init=False, repr=False)
    w_ext_B: Array = field(init=False, repr=False)
    load: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        m = len(self.contacts)
        object.__setattr__(self, "contact_set", ContactSet.of(self.contacts))
        _check_shape("R_OC", self.R_OC, (m, 3, 3))
        _check_shape("p_OC_O", self.p_OC_O, (m, 3))
        _check_shape("w_ext_O", self.w_ext_O, (6,))
        _check_finite("p_OC_O", self.p_OC_O)
        _check_finite("w_ext_O", self.w_ext_O)
        self._check_rotations()
        if not self.hands and self.objective is not Objective.FRICTION_MARGIN:
            raise InvalidInputError("contacts", "no hand", f"a hand, as {self.objective} asks")
        if self.objective is Objective.FRICTION_MARGIN and all(
            c.model is ContactModel.FRICTIONLESS for c in self.contacts
        ):
            raise InvalidInputError(
                "contacts", "no friction", f"friction, as {self.objective} asks"
            )
        if self.joints is None and self.objective.needs_joints:
            raise InvalidInputError("joints", None, f"joints, as objective {self.objective} asks")
        if self.joints is not None:
            self._check_joints(self.joints)
        self._set_balance()
        object.__setattr__(self, "load", self._load())

    def _set_balance(self) -> None:
        p_OC_O, w_ext_O = self.p_OC_O, self.w_ext_O
        low, high = p_OC_O.min(axis=0), p_OC_O.max(axis=0)
        middle, spread = 0.5 * (low + high), high - low
        if math.sqrt(middle.dot(middle)) <= _NEAR * math.sqrt(spread.dot(spread)):
            p_OB_O, p_BC_O = _ORIGIN, p_OC_O
        else:
            p_OB_O, p_BC_O = middle, p_OC_O - middle
        object.__setattr__(self, "p_OB_O", p_OB_O)
        object.__setattr__(self, "G", grasp_maps(self.R_OC, p_BC_O))
        object.__setattr__(self, "w_ext_B", self.about_B(w_ext_O))

    def about_B(self, w_O: Array) -> Array:
        """Wrench in the object frame [N, N·m], (6,), with its moment about B instead."""
        if not self.p_OB_O.any():
            return w_O
        return np.concatenate([w_O[:3], w_O[3:] - np.cross(self.p_OB_O, w_O[:3])])

    def _check_rotations(self) -> None:
        squares = _check_finite("R_OC", self.R_OC)
        determinants = np.linalg.det(self.R_OC)
        # Of all matrices with determinant 1, rotations alone have a sum of squares as small as 3:
        # with singular values 1 + e_i it is 3 + 2 sum e_i^2, to second order. Most end here.
        numbers = determinants.tolist()
        if (
            min(numbers) >= 1.0 - _UNIT_DETERMINANT
            and max(numbers) <= 1.0 + _UNIT_DETERMINANT
            and squares - len(numbers) - 2.0 * sum(numbers) <= 0.25 * _ROTATION_TOLERANCE**2
        ):
            return
        deviation = np.abs(self.R_OC @ self.R_OC.transpose(0, 2, 1) - np.eye(3))
        proper = (deviation.max(axis=(1, 2)) <= _ROTATION_TOLERANCE) & (determinants > 0.0)
        if not proper.all():
            worst = self.contacts[int(np.argmin(proper))].name
            raise InvalidInputError(
                f"R_OC[{worst}]", "a matrix that is no rotation", "orthonormal with determinant +1"
            )

    def _check_joints(self, joints: Joints) -> None:
        if len(joints.J_C) != len(self.hands):
            raise InvalidInputError(
                "joints.J_C",
                f"{len(joints.J_C)} Jacobians",
                f"one for each of the {len(self.hands)} hand contacts",
            )
        if self.objective is Objective.MAX_TORQUE_UTILISATION:
            usable = np.isfinite(joints.tau_min) & np.isfinite(joints.tau_max)
            usable &= (joints.tau_min < 0.0) & (joints.tau_max > 0.0)
            if not usable.all():
                worst = int(np.argmin(usable))
                raise InvalidInputError(
                    f"joints.tau_min[{joints.names[worst]}], tau_max",
                    (float(joints.tau_min[worst]), float(joints.tau_max[worst])),
                    f"finite with tau_min < 0 < tau_max, as objective {self.objective} asks",
                )

    @property
    def hands(self) -> tuple[int, ...]:
        """Indices of the hand contacts, in the order of the Jacobians."""
        return self.contact_set.hands

    def _load(self) -> float:
        load = max(*map(abs, self.w_ext_B.tolist()), self.contact_set.preload)
        if self.joints is not None and self.objective.needs_joints:
            load = max(load, *map(abs, self.joints.tau_g.tolist()))
        return load

    def torque(self, w_OC_C: Array) -> Array:
        """Joint torques [N·m or N], (l,), that go with contact wrenches, (m, 6): (15)."""
        if self.joints is None:
            return np.zeros(0)
        J = self.joints.J_C.reshape(-1, len(self.joints.names))
        return w_OC_C[self.contact_set.hand_rows].ravel().dot(J) + self.joints.tau_g

    def page(self) -> Page:
        """Return contacts, external wrench and joints as a page."""
        rows = []
        for contact, p in zip(self.contacts, self.p_OC_O, strict=True):
            rough = contact.model is not ContactModel.FRICTIONLESS
            rows.append(
                (
                    contact.name,
                    contact.role,
                    contact.model,
                    number(contact.mu) if rough else "",
                    number(contact.e_n) if contact.model is ContactModel.SFCE else "",
                    f"{number(contact.f_n_min)} to {number(contact.f_n_max)}",
                    numbers(p, 3),
                )
            )
        head = ("contact", "role", "model", "μ", "e_n [m]", "f_n [N]", "place on the object [m]")
        force, moment = map(numbers, np.split(self.w_ext_O, 2))
        joints = self.joints
        return page(
            (Marked("Problem (17)"), f": minimise {self.objective}"),
            table(head, rows),
            f"External force ({force}) N, moment ({moment}) N·m, in the object's axes.",
            "No joints: torques are not limited."
            if joints is None
            else f"{len(joints.names)} joints: {', '.join(joints.names)}.",
        )

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


def _check_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise InvalidInputError(name, f"shape {array.shape}", f"shape {shape}")


def _check_finite(name: str, array: Array) -> float:
    """The sum of squares, which if finite proves at once that all numbers are."""
    flat = array.ravel()
    squares = float(flat.dot(flat))
    # Where it is not finite, the numbers may be merely large.
    if not math.isfinite(squares) and not np.isfinite(array).all():
        raise InvalidInputError(name, "a value that is NaN or infinite", "finite numbers")
    return squares


@dataclass(frozen=True, eq=False)
class Gravity:
    """The object's weight; the external wrench may hold more than it.

    Attributes:
        weight: [N].
        direction_O: Unit vector along which it pulls, in the object's axes, (3,).
        center_O: Centre of mass in the object frame [m], (3,).
    """

    weight: float
    direction_O: Array
    center_O: Array

    @property
    def wrench_O(self) -> Array:
        """The weight's wrench in the object frame [N, N·m], (6,)."""
        force = self.weight * self.direction_O
        return np.concatenate([force, np.cross(self.center_O, force)])
