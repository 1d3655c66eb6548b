"""What a scenario is: frozen data about object, contacts, robot, path and how it is run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from sim.checks import axes, length, not_negative, positive, vector
from sim.course import Pivot as Pivot
from sim.course import Poses as Poses
from sim.manipulator import Robot as Robot
from sim.pose import Pose as Pose
from sim.pose import Quaternion as Quaternion
from sim.pose import Vector as Vector
from sim.settings import (
    FARTHEST_M,
    HOLD,
    REACH,
    STANDOFF,
    TILT,
    Control,
    Phase,
    Physics,
    Tolerances,
)
from synthesis import InvalidInputError

if TYPE_CHECKING:
    from sim.shape import Shape

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Geom:
    """A primitive in MuJoCo's terms, or a mesh, which touches as its convex hull does.

    Attributes:
        name: Unique in the scene.
        kind: Geom type as MuJoCo names it: plane, sphere, capsule, ellipsoid, cylinder, box, mesh.
        size: Sizes as MuJoCo reads them (half extents; radius, half length) [m]; of a mesh its
            scale, as one number or one along each axis.
        pose: Pose in the frame of the owner (object or world).
        rgba: Colour and opacity, each 0 to 1; geoms of opacity 0 are not drawn.
        solid: Whether the robot must keep clear of it (but for tips where they hold the object).
        file: Of a mesh; None for all others.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    pose: Pose = Pose()
    rgba: tuple[float, float, float, float] = (0.6, 0.6, 0.6, 1.0)
    solid: bool = True
    file: str | None = None

    def __post_init__(self) -> None:
        for size in self.size:
            positive(f"{self.name}.size", size)
        if not 1 <= len(self.size) <= 3:
            raise InvalidInputError(f"{self.name}.size", self.size, "one to three numbers")
        vector(f"{self.name}.rgba", self.rgba, 4)
        if (self.kind == "mesh") != (self.file is not None):
            valid = "a file for the kind mesh, and none for any other"
            raise InvalidInputError(f"{self.name}.file", self.file, valid)


@dataclass(frozen=True)
class Object:
    """The thing that is tilted.

    Attributes:
        name: What people call it.
        mass: [kg].
        inertia: Principal moments about the centre of mass [kg m^2].
        center_of_mass: In the object frame [m].
        geoms: What it is made of; contacts refer to these by name.
        principal_axes: Orientation of the principal axes in the object frame, wxyz.
        shape: What its geoms stand for, if it is a shape of :mod:`sim.shapes`.
    """

    name: str
    mass: float
    inertia: Vector
    geoms: tuple[Geom, ...]
    center_of_mass: Vector = (0.0, 0.0, 0.0)
    principal_axes: Quaternion = (1.0, 0.0, 0.0, 0.0)
    shape: Shape | None = None

    def __post_init__(self) -> None:
        positive(f"{self.name}.mass", self.mass)
        length(f"{self.name}.inertia", self.inertia, 3)
        for moment in self.inertia:
            positive(f"{self.name}.inertia", moment)
        vector(f"{self.name}.center_of_mass", self.center_of_mass, 3)
        Pose(quaternion=self.principal_axes)

    def weighing(self, factor: float) -> Object:
        """The object with so many times the mass, and inertia in proportion."""
        x, y, z = self.inertia
        inertia = (factor * x, factor * y, factor * z)
        return replace(self, mass=factor * self.mass, inertia=inertia)


@dataclass(frozen=True)
class Friction:
    """Coulomb friction with the ellipticities of the paper's (1) and (2).

    Attributes:
        mu: Coefficient [-].
        e_n: Torsional over tangential friction [m]; None for a contact that carries no torsion.
    """

    mu: float
    e_n: float | None = None

    def __post_init__(self) -> None:
        positive("friction.mu", self.mu)
        if self.e_n is not None:
            positive("friction.e_n", self.e_n)


@dataclass(frozen=True)
class Hand:
    """A robot's end effector and the place where it holds the object.

    The contact axes are n = ``normal_O``, t = ``tangent_O`` and o = n x t; the hand's tip axes (x,
    y, z) coincide with (t, o, n), so that the hand turns with the object.

    Attributes:
        name: Name of the contact and prefix of the hand's parts.
        mount: Body of a robot that carries the hand, with the robot's prefix.
        model: Name of one that ships (see ``assets.HANDS``), or path of an MJCF file with a body
            ``pad`` that has a spherical geom ``tip`` and a site ``tip_center``.
        geom: The object's geom that is touched.
        p_OC_O: Contact point in the object frame [m].
        normal_O: Inward normal in the object's axes.
        tangent_O: First tangent in the object's axes, perpendicular to the normal.
        friction: Between tip and object.
        f_n_max: Largest allowed normal force [N].
        mount_pose: Of the body ``pad`` on the mount.
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
        geom: The object's geom that touches.
        surface: Name of the environment's geom that is touched.
        p_OP_O: The point in the object frame [m].
        normal_W: Surface normal in world axes, into the object.
        tangent_W: First tangent in world axes, perpendicular to the normal.
        friction: Between object and surface.
    """

    name: str
    geom: str
    surface: str
    p_OP_O: Vector
    normal_W: Vector
    tangent_W: Vector
    friction: Friction

    def __post_init__(self) -> None:
        axes(self.name, ("normal_W", self.normal_W), ("tangent_W", self.tangent_W))
        vector(f"{self.name}.p_OP_O", self.p_OP_O, 3)


@dataclass(frozen=True)
class Rest:
    """Where the object may lie on the environment without the synthesis counting on it.

    Attributes:
        geom: The object's geom that touches.
        surface: Name of the environment's geom that is touched.
        friction: Between object and surface.
    """

    geom: str
    surface: str
    friction: Friction


@dataclass(frozen=True)
class View:
    """Where recordings look from, relative to the path's point [m].

    Attributes:
        eye: Where the eye stands.
        target: What it looks at.
    """

    eye: Vector = (1.0, -0.5, 0.62)
    target: Vector = (0.05, 0.0, 0.12)


@dataclass(frozen=True)
class Scenario:
    """Everything that a run needs to know; nothing else may distinguish one scene from another.

    ``holdable`` says whether forces that hold the object are expected to exist all along the path;
    a scenario that shows the contrary says False. ``rests`` is where the object may lie besides
    its supports, ``standoff`` the distance of the hands from their contacts at the start [m].
    """

    name: str
    summary: str
    object: Object
    environment: tuple[Geom, ...]
    hands: tuple[Hand, ...]
    supports: tuple[Support, ...]
    robots: tuple[Robot, ...]
    path: Pivot | Poses
    rests: tuple[Rest, ...] = ()
    phases: tuple[Phase, ...] = (*REACH, *TILT, *HOLD)
    standoff: float = STANDOFF
    holdable: bool = True
    control: Control = Control()
    physics: Physics = Physics()
    tolerances: Tolerances = Tolerances()
    view: View = View()

    def __post_init__(self) -> None:
        not_negative("standoff", self.standoff)
        if self.standoff > FARTHEST_M:
            raise InvalidInputError("standoff", self.standoff, f"at most {FARTHEST_M:g} m")
        if not self.phases:
            raise InvalidInputError("phases", self.phases, "at least one phase")
        for name in self.contact_names:
            if self.contact_names.count(name) > 1:
                raise InvalidInputError("contact names", name, "a name that no other contact has")
        prefixes = [robot.prefix for robot in self.robots]
        for prefix in prefixes:
            if prefixes.count(prefix) > 1:
                valid = "a prefix that no other robot has"
                raise InvalidInputError("robot.prefix", repr(prefix), valid)
        geoms = [g.name for g in self.object.geoms]
        touched = [(hand.name, hand.geom) for hand in self.hands]
        touched += [(support.name, support.geom) for support in self.supports]
        touched += [("rest", rest.geom) for rest in self.rests]
        for name, geom in touched:
            if geom not in geoms:
                raise InvalidInputError(f"{name}.geom", geom, f"one of {', '.join(geoms)}")
        surfaces = [g.name for g in self.environment]
        for name in (*geoms, *surfaces):
            if [*geoms, *surfaces].count(name) > 1:
                raise InvalidInputError("geom names", name, "a name that no other geom has")
        placed = [(support.name, support.surface) for support in self.supports]
        placed += [("rest", rest.surface) for rest in self.rests]
        for name, surface in placed:
            if surface not in surfaces:
                raise InvalidInputError(f"{name}.surface", surface, f"one of {', '.join(surfaces)}")

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of all contacts, hands first: the order of every per-contact array."""
        return (*(hand.name for hand in self.hands), *(support.name for support in self.supports))

    @property
    def posture(self) -> dict[str, float]:
        """Start angle [rad or m] of every driven joint of all robots, by its name in the scene."""
        robots = self.robots
        return {r.prefix + joint: angle for r in robots for joint, angle in r.posture.items()}

    @property
    def still(self) -> tuple[str, ...]:
        """Joints that keep still where they can, by their names in the scene."""
        return tuple(robot.prefix + joint for robot in self.robots for joint in robot.still)

    @property
    def start_deviation(self) -> dict[str, float]:
        """Standard deviation of every driven joint's start [rad or m], by its name in the scene."""
        return {r.prefix + joint: r.start_deviation for r in self.robots for joint in r.posture}

    def _repr_markdown_(self) -> str:
        from sim.notebook import scenario_markdown

        return scenario_markdown(self)


def lifted(scenario: Scenario) -> Scenario:
    """The scenario without its environment contacts: the object lies there, but is to come off."""
    rests = {Rest(s.geom, s.surface, s.friction) for s in scenario.supports}
    rests |= set(scenario.rests)
    ordered = tuple(sorted(rests, key=lambda rest: (rest.surface, rest.geom)))
    return replace(scenario, supports=(), rests=ordered, holdable=False)
