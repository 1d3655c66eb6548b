"""The contact force synthesis problem, (17) of the paper, as checked and frozen data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from operator import le

import numpy as np

from fulcrum.synthesis import checks
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.contact import Contact, ContactModel, ContactSet, check_names, grasp_maps
from fulcrum.synthesis.errors import InvalidInputError
from fulcrum.synthesis.markdown import number, numbers
from fulcrum.synthesis.render import Marked, Page, page, table, to_markdown

# Rotation matrices come from integrated quaternions: 1e-6 accepts those, and nothing mis-scaled.
_ROTATION_TOLERANCE = 1e-6
# Largest deviation of a determinant from 1 in the quick proof of a rotation.
_UNIT_DETERMINANT = 1e-2 * _ROTATION_TOLERANCE
_ORIGIN = np.zeros(3)
_ORIGIN.setflags(write=False)
# Moments are about the object frame's origin up to this distance from the contacts, in units of
# their spread [-]. On 60 random problems, forces then deviate by up to 1e-8, the solver's own
# tolerance. About origins farther away they deviate by 6e-7 at 250 spreads, by a quarter at 2500,
# and by all of their size at 25,000; about the middle of the contacts by 3e-8 at 1e6 m.
_NEAR = 10.0


class Objective(StrEnum):
    """The quantity to minimise: the paper's four, torque utilisation and friction margin."""

    MAX_NORMAL_FORCE = "max-normal-force"
    NORM_NORMAL_FORCE = "norm-normal-force"
    MAX_TORQUE = "max-torque"
    NORM_TORQUE = "norm-torque"
    MAX_TORQUE_UTILISATION = "max-torque-utilisation"
    FRICTION_MARGIN = "friction-margin"

    @property
    def needs_joints(self) -> bool:
        """Return whether the objective is a function of the joint torques."""
        return "torque" in self


@dataclass(frozen=True, eq=False)
class Joints:
    r"""The joints that produce the hand contact forces, (13) to (16) of the paper.

    With :math:`f_C` the wrench on the object and :math:`\tau_g` the torque that holds the arm up
    (the generalised gravity), statics is :math:`\tau = J^T f_C + \tau_g`; the paper's (13) is the
    same with the signs of the torques flipped.

    Attributes:
        names: Names of the l joints.
        J_C: Jacobian of each hand contact in the problem's order, (n, 6, l): twist of the end
            effector's point at the contact, in contact axes, linear part first. A joint that
            several contacts share (a wrist) has a column in each.
        tau_g: Torque that balances gravity on the arm [N·m or N], (l,).
        tau_min: Lower torque limits [N·m or N], (l,); may be -inf.
        tau_max: Upper torque limits [N·m or N], (l,); may be inf.

    Raises:
        InvalidInputError: A field is not finite, has a wrong shape or contradicts another.
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
        checks.sum_of_squares("joints.J_C", self.J_C)
        checks.array("joints.tau_g", self.tau_g, (joints,))
        checks.shape("joints.tau_min", self.tau_min, (joints,))
        checks.shape("joints.tau_max", self.tau_max, (joints,))
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

    @property
    def largest_limit(self) -> float:
        """Return the largest torque limit of all joints [N·m or N]."""
        return float(max(self.tau_max.max(), -self.tau_min.min()))


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
        contacts: The m contacts.
        R_OC: Contact axes (t, o, n) in the object's axes, n into the object, (m, 3, 3).
        p_OC_O: Contact positions in the object frame [m], (m, 3).
        w_ext_O: External wrench on the object, weight included, in the object frame [N, N·m], (6,).
        joints: Joints of the hand contacts; None leaves (15) and (16) out.
        objective: Phi.
        contact_set: Parameters of the contacts as arrays; derived.
        p_OB_O: Reference point B of the moments in (12), in the object frame [m], (3,); derived.
            It is the frame's origin, or the middle of the contacts if equations about a far origin
            would lose digits.
        G: Grasp maps with moments about B, (m, 6, 6); derived.
        w_ext_B: External wrench with its moment about B [N, N·m], (6,); derived.
        load: Largest of external wrench, preload and, for torque objectives, gravity torque
            [N or N·m]; derived.

    Raises:
        InvalidInputError: A field is not finite, has a wrong shape or contradicts another.
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
        checks.shape("R_OC", self.R_OC, (m, 3, 3))
        checks.array("p_OC_O", self.p_OC_O, (m, 3))
        checks.array("w_ext_O", self.w_ext_O, (6,))
        self._check_rotations()
        asks = f"as objective {self.objective} asks"
        if self.objective is Objective.FRICTION_MARGIN:
            if not self.contact_set.rough.any():
                raise InvalidInputError("contacts", "no friction", f"friction, {asks}")
        elif not self.hands:
            raise InvalidInputError("contacts", "no hand", f"a hand, {asks}")
        if self.joints is not None:
            self._check_joints(self.joints, asks)
        elif self.objective.needs_joints:
            raise InvalidInputError("joints", None, f"joints, {asks}")
        self._set_balance()
        load = max(*map(abs, self.w_ext_B.tolist()), self.contact_set.preload)
        if self.joints is not None and self.objective.needs_joints:
            load = max(load, *map(abs, self.joints.tau_g.tolist()))
        object.__setattr__(self, "load", load)

    def _set_balance(self) -> None:
        low, high = self.p_OC_O.min(axis=0), self.p_OC_O.max(axis=0)
        middle, spread = 0.5 * (low + high), high - low
        near = math.sqrt(middle.dot(middle)) <= _NEAR * math.sqrt(spread.dot(spread))
        p_BC_O = self.p_OC_O if near else self.p_OC_O - middle
        object.__setattr__(self, "p_OB_O", _ORIGIN if near else middle)
        object.__setattr__(self, "G", grasp_maps(self.R_OC, p_BC_O))
        object.__setattr__(self, "w_ext_B", self.about_B(self.w_ext_O))

    def about_B(self, w_O: Array) -> Array:
        """Return a wrench in the object frame [N, N·m], (6,), with its moment about B."""
        if not self.p_OB_O.any():
            return w_O
        return np.concatenate([w_O[:3], w_O[3:] - np.cross(self.p_OB_O, w_O[:3])])

    def _check_rotations(self) -> None:
        squares = checks.sum_of_squares("R_OC", self.R_OC)
        determinants = np.linalg.det(self.R_OC)
        # Among all matrices with determinant 1, only rotations have a sum of squares as small as 3:
        # with singular values 1 + e_i it is 3 + 2 sum e_i^2, to second order. Most return here.
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

    def _check_joints(self, joints: Joints, asks: str) -> None:
        given, hands = len(joints.J_C), len(self.hands)
        if given != hands:
            valid = f"one for each of the {hands} hand contacts"
            raise InvalidInputError("joints.J_C", f"{given} Jacobians", valid)
        if self.objective is Objective.MAX_TORQUE_UTILISATION:
            usable = np.isfinite(joints.tau_min) & np.isfinite(joints.tau_max)
            usable &= (joints.tau_min < 0.0) & (joints.tau_max > 0.0)
            if not usable.all():
                worst = int(np.argmin(usable))
                raise InvalidInputError(
                    f"joints.tau_min[{joints.names[worst]}], tau_max",
                    (float(joints.tau_min[worst]), float(joints.tau_max[worst])),
                    f"finite with tau_min < 0 < tau_max, {asks}",
                )

    @property
    def unit(self) -> float:
        """Return the unit of forces and torques inside the solver: the load, or 1 without load."""
        return self.load or 1.0

    @property
    def hands(self) -> tuple[int, ...]:
        """Return the indices of the hand contacts, in the order of the Jacobians."""
        return self.contact_set.hands

    def imbalance(self, w_OC_C: Array) -> Array:
        """Return the residual of (12) [N, N·m], (6,), at contact wrenches, (m, 6)."""
        return np.einsum("mkj,mj->k", self.G, w_OC_C) + self.w_ext_B

    def torque(self, w_OC_C: Array) -> Array:
        """Return the joint torques of (15) [N·m or N], (l,), at contact wrenches, (m, 6)."""
        if self.joints is None:
            return np.zeros(0)
        J = self.joints.J_C.reshape(-1, len(self.joints.names))
        return w_OC_C[self.contact_set.hand_rows].ravel().dot(J) + self.joints.tau_g

    def page(self) -> Page:
        """Return contacts, external wrench and joints as a page."""
        rows = []
        for contact, p in zip(self.contacts, self.p_OC_O, strict=True):
            rows.append(
                (
                    contact.name,
                    contact.role,
                    contact.model,
                    number(contact.mu) if contact.model.has_friction else "",
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


@dataclass(frozen=True, eq=False)
class Gravity:
    """The object's weight, which is part of the external wrench.

    Attributes:
        weight: Weight [N].
        direction_O: Direction of gravity, a unit vector in the object's axes, (3,).
        center_O: Centre of mass in the object frame [m], (3,).
    """

    weight: float
    direction_O: Array
    center_O: Array

    @property
    def wrench_O(self) -> Array:
        """Return the weight's wrench in the object frame [N, N·m], (6,)."""
        force = self.weight * self.direction_O
        return np.concatenate([force, np.cross(self.center_O, force)])
