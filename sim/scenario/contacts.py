"""Contacts of a scenario: hands, supports and rests, with friction and material."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from fulcrum.sim.geometry import Pose
from fulcrum.sim.scenario.material import PAD, SUPPORT, ContactMaterial
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Vector
from fulcrum.synthesis.checks import axes, vector
from fulcrum.synthesis.settings import Key, Positive, Settings


@dataclass(frozen=True)
class Friction(Settings):
    """Coulomb friction of a pair of surfaces, with the ellipticities of the paper's (1) and (2)."""

    mu: Positive
    """Coefficient of friction [-]."""

    e_n: Annotated[Positive | None, Key("torsion_m")] = None
    """Torsional over tangential friction [m] of a soft contact: two thirds of the radius of a
    round pad under even pressure. Without it the contact is a hard point."""


@dataclass(frozen=True)
class Hand:
    """A robot's end effector and the place where it holds the object.

    The contact axes are n = ``normal_O``, t = ``tangent_O`` and o = n x t. The hand's tip axes (x,
    y, z) coincide with (t, o, n), so the hand turns with the object.

    Attributes:
        name: Name of the contact and prefix of the hand's parts.
        mount: Name of the robot's body that carries the hand, with the robot's prefix.
        model: Name of a shipped hand (see ``assets.HANDS``), or path of an MJCF file with a body
            ``pad`` that has a spherical geom ``tip`` and a site ``tip_center``.
        geom: Name of the object's geom that is touched.
        p_OC_O: Contact point in the object frame [m].
        normal_O: Inward normal in the object's axes.
        tangent_O: First tangent in the object's axes, perpendicular to the normal.
        friction: Friction between tip and object.
        f_n_max: Largest allowed normal force [N].
        mount_pose: Pose of the body ``pad`` on the mount.
        material: Stiffness and damping of tip and object together.
    """

    name: str
    mount: str
    model: str
    geom: str
    p_OC_O: Vector
    normal_O: Vector
    tangent_O: Vector
    friction: Friction
    f_n_max: float = math.inf
    mount_pose: Pose = Pose()
    material: ContactMaterial = PAD

    def __post_init__(self) -> None:
        axes(self.name, ("normal_O", self.normal_O), ("tangent_O", self.tangent_O))
        vector(f"{self.name}.p_OC_O", self.p_OC_O, 3)
        if not self.f_n_max > 0.0:
            raise InvalidInputError(f"{self.name}.f_n_max", self.f_n_max, "a number > 0")


@dataclass(frozen=True)
class Support:
    """A point of the object that stays on the environment while the object pivots.

    Attributes:
        name: Name of the contact.
        geom: Name of the object's geom that touches.
        surface: Name of the environment's geom that is touched.
        p_OP_O: Contact point in the object frame [m].
        normal_W: Surface normal in world axes, into the object.
        tangent_W: First tangent in world axes, perpendicular to the normal.
        friction: Friction between object and surface.
        material: Stiffness and damping of object and surface together.
    """

    name: str
    geom: str
    surface: str
    p_OP_O: Vector
    normal_W: Vector
    tangent_W: Vector
    friction: Friction
    material: ContactMaterial = SUPPORT

    def __post_init__(self) -> None:
        axes(self.name, ("normal_W", self.normal_W), ("tangent_W", self.tangent_W))
        vector(f"{self.name}.p_OP_O", self.p_OP_O, 3)


@dataclass(frozen=True)
class Rest:
    """A place where the object may lie on the environment; the synthesis does not count on it.

    Attributes:
        geom: Name of the object's geom that touches.
        surface: Name of the environment's geom that is touched.
        friction: Friction between object and surface.
        material: Stiffness and damping of object and surface together.
    """

    geom: str
    surface: str
    friction: Friction
    material: ContactMaterial = SUPPORT
