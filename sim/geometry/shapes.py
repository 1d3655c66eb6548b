"""The shapes that objects have: cuboid, full and hollow cylinder, mesh."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.mesh import Mesh, read_mesh
from fulcrum.sim.geometry.pose import Pose, Quaternion, triple, wxyz
from fulcrum.sim.geometry.shape import AXES, COLOR, UNTURNED, Color, Place, Shape, cyclic
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector
from fulcrum.synthesis.settings import Key, Positive, Text

Axis = Literal["x", "y", "z"]
Length = Annotated[Positive, Key("length_m")]

# Flat pieces of a hollow cylinder's wall. Their middles lie on its surfaces; where two meet, they
# are 0.5 % of the radius, R (1 - cos(pi / 32)), inside the outer one.
_STAVES = 32
# Rotations from the z axis to each axis.
_TURNS: dict[Axis, Quaternion] = {
    "x": (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0),
    "y": (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0),
    "z": UNTURNED,
}


@dataclass(frozen=True)
class Box(Shape):
    """A cuboid centred on the origin; faces "+x", "-x", "+y", "-y", "+z", "-z".

    Its edges are along the object's axes. On a face normal to an axis, u runs along the next axis
    (after z comes x) and v along the third.
    """

    size: Annotated[tuple[Positive, Positive, Positive], Key("size_m")]
    """Lengths of its edges along its x, y and z [m]."""

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of the faces."""
        return tuple(f"{sign}{axis}" for axis in AXES for sign in "+-")

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return math.prod(self.size)

    def inertia(self, mass: float) -> Vector:
        """Return the principal moments [kg m^2] about the centre of mass for uniform density."""
        (x, y, z), twelfth = self.size, mass / 12.0
        return (twelfth * (y**2 + z**2), twelfth * (x**2 + z**2), twelfth * (x**2 + y**2))

    def geoms(self, name: str, rgba: Color = COLOR) -> tuple[Geom, ...]:
        """Return one geom of the given name."""
        x, y, z = self.size
        return (Geom(name, "box", (x / 2, y / 2, z / 2), rgba=rgba),)

    def scaled(self, factor: float) -> Box:
        """Return a copy with all lengths multiplied by `factor`."""
        return Box(triple(factor * np.array(self.size)))

    def _closest(self, p_O: Array) -> Place:
        half = np.array(self.size) / 2.0
        axis = int(np.argmax(np.abs(p_O) - half))
        side = math.copysign(1.0, p_O[axis])
        point = np.clip(p_O, -half, half)
        point[axis] = side * half[axis]
        face = f"{'+' if side > 0.0 else '-'}{AXES[axis]}"
        return Place(triple(point), triple(0.0 - side * np.eye(3)[axis]), face)

    def _place(self, face: str, u: float, v: float) -> Place:
        axis, side = AXES.index(face[1]), 1.0 if face[0] == "+" else -1.0
        shares = cyclic(face[1], (side + 1.0) / 2.0, u, v)
        point = (np.array(shares) - 0.5) * self.size
        return Place(triple(point), triple(0.0 - side * np.eye(3)[axis]), face)


class _Round(Shape):
    """Base class of full and hollow cylinders: walls about an axis, and two ends."""

    length: Length
    axis: Axis

    @property
    @abstractmethod
    def _walls(self) -> dict[str, float]:
        """Radius [m] of every wall by the name of its face, the outer wall first."""

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of the faces."""
        return (*self._walls, f"+{self.axis}", f"-{self.axis}")

    @property
    def _radii(self) -> tuple[float, float]:
        """Inner and outer radius [m]; the inner one is 0 without a bore."""
        outer, *inner = self._walls.values()
        return (inner[0] if inner else 0.0), outer

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        inner, outer = self._radii
        return math.pi * (outer**2 - inner**2) * self.length

    def inertia(self, mass: float) -> Vector:
        """Return the principal moments [kg m^2] about the centre of mass for uniform density."""
        inner, outer = self._radii
        along = mass / 2 * (outer**2 + inner**2)
        across = mass / 12 * (3 * (outer**2 + inner**2) + self.length**2)
        return cyclic(self.axis, along, across, across)

    def _full(self, name: str, rgba: Color, solid: bool = True) -> Geom:
        size = (self._radii[1], self.length / 2)
        return Geom(name, "cylinder", size, Pose(quaternion=_TURNS[self.axis]), rgba, solid)

    def _closest(self, p_O: Array) -> Place:
        along, first, second = np.roll(p_O, -AXES.index(self.axis)).tolist()
        radius, angle = math.hypot(first, second), math.atan2(second, first)
        inner, outer = self._radii
        end = f"{'-' if along < 0.0 else '+'}{self.axis}"
        excess = {end: abs(along) - self.length / 2}
        for face, wall in self._walls.items():
            excess[face] = radius - wall if wall == outer else wall - radius
        face = max(excess, key=lambda name: excess[name])
        along = min(max(along, -self.length / 2), self.length / 2)
        radius = min(max(radius, inner), outer)
        if face == end:
            along = math.copysign(self.length / 2, along)
        return self._at(face, self._walls.get(face, radius), angle, along)

    def _place(self, face: str, u: float, v: float) -> Place:
        if face in self._walls:
            return self._at(face, self._walls[face], 2 * math.pi * u, (v - 0.5) * self.length)
        inner, outer = self._radii
        along = self.length / 2 if face[0] == "+" else -self.length / 2
        return self._at(face, inner + v * (outer - inner), 2 * math.pi * u, along)

    def _at(self, face: str, radius: float, angle: float, along: float) -> Place:
        """Return the point at a radius [m], an angle [rad] about and a place [m] along the axis."""
        across = (math.cos(angle), math.sin(angle))
        point = cyclic(self.axis, along, radius * across[0], radius * across[1])
        if face in self._walls:
            inward = -1.0 if radius == self._radii[1] else 1.0
            normal = cyclic(self.axis, 0.0, inward * across[0], inward * across[1])
        else:
            normal = cyclic(self.axis, -math.copysign(1.0, along), 0.0, 0.0)
        return Place(point, normal, face)


@dataclass(frozen=True)
class Cylinder(_Round):
    """A solid cylinder about the origin; faces "side" and the ends, by default "+z" and "-z".

    On the side, u runs around the axis, starting at the object axis that follows it (x after z),
    and v along it. On an end, u runs around, too, and v from the middle to the rim.
    """

    radius: Annotated[Positive, Key("radius_m")]
    """Radius [m]."""

    length: Length
    """Length [m]."""

    axis: Axis = "z"
    """Axis of the object that is the cylinder's axis."""

    @property
    def _walls(self) -> dict[str, float]:
        return {"side": self.radius}

    def geoms(self, name: str, rgba: Color = COLOR) -> tuple[Geom, ...]:
        """Return one geom of the given name."""
        return (self._full(name, rgba),)

    def scaled(self, factor: float) -> Cylinder:
        """Return a copy with all lengths multiplied by `factor`."""
        return replace(self, radius=factor * self.radius, length=factor * self.length)


@dataclass(frozen=True)
class HollowCylinder(_Round):
    """A tube about the origin; faces "outside", "inside" and the ends, by default "+z" and "-z".

    Coordinates are those of a :class:`Cylinder`, with two differences: on an end, v runs from the
    bore to the rim; on a wall, u goes in steps, since hands touch flat staves in their middles.
    """

    outer_radius: Annotated[Positive, Key("outer_radius_m")]
    """Outer radius [m]."""

    inner_radius: Annotated[Positive, Key("inner_radius_m")]
    """Inner radius [m]."""

    length: Length
    """Length [m]."""

    axis: Axis = "z"
    """Axis of the object that is the cylinder's axis."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.inner_radius < self.outer_radius:
            valid = f"less than the outer_radius of {self.outer_radius:g} m"
            raise InvalidInputError("shape.inner_radius", self.inner_radius, valid)

    @property
    def _walls(self) -> dict[str, float]:
        return {"outside": self.outer_radius, "inside": self.inner_radius}

    @property
    def resting(self) -> str:
        """Name of the geom that touches the environment."""
        return "rim"

    def geoms(self, name: str, rgba: Color = COLOR) -> tuple[Geom, ...]:
        """Return an invisible full cylinder ``rim`` and the staves ``wall``, ``stave_1`` ..

        Supports touch the rim, since a full cylinder has exact rim points; a finger may be inside
        it. Hands touch staves; ``wall`` is at the second axis after the cylinder's (z for x).
        """
        rim = self._full("rim", (0.0, 0.0, 0.0, 0.0), solid=False)
        return (rim, *(self._stave(i, rgba) for i in range(_STAVES)))

    def _stave(self, i: int, rgba: Color) -> Geom:
        """Return flat piece i of the wall, counted from the second axis after the cylinder's.

        Neighbours meet at the bore: overlapping pieces would show through each other.
        """
        inner, outer = self._radii
        angle, middle = 2 * math.pi * i / _STAVES, (outer + inner) / 2
        at = (-middle * math.sin(angle), middle * math.cos(angle))
        half = (self.length / 2, inner * math.tan(math.pi / _STAVES), (outer - inner) / 2)
        turn = (math.cos(angle / 2), *cyclic(self.axis, math.sin(angle / 2), 0.0, 0.0))
        pose = Pose(cyclic(self.axis, 0.0, *at), turn)
        return Geom(_stave_name(i), "box", cyclic(self.axis, *half), pose, rgba)

    def touched(self, name: str, p_O: Vector) -> str:
        """Return the name of the stave that a hand at p_O [m] touches."""
        _, first, second = np.roll(p_O, -AXES.index(self.axis)).tolist()
        turns = (math.atan2(second, first) - math.pi / 2) / (2 * math.pi)
        return _stave_name(round(turns * _STAVES) % _STAVES)

    def scaled(self, factor: float) -> HollowCylinder:
        """Return a copy with all lengths multiplied by `factor`."""
        inner, outer = self._radii
        return HollowCylinder(factor * outer, factor * inner, factor * self.length, self.axis)

    def _place(self, face: str, u: float, v: float) -> Place:
        return super()._place(face, round(u * _STAVES) / _STAVES if face in self._walls else u, v)


def _stave_name(i: int) -> str:
    return f"stave_{i}" if i else "wall"


@dataclass(frozen=True)
class MeshShape(Shape):
    """A closed mesh of any shape, in the frame of its file; its only face is "surface".

    Contacts are made with the mesh's convex hull, so hollows cannot be touched. u is the angle
    about the z axis through the centre of mass, from x; v runs from the lower to the upper end.
    The place is the outermost point of the surface in that direction.
    """

    file: Text
    """STL, OBJ or PLY file, relative to the scenario file and in or below its folder."""

    scale: Positive = 1.0
    """Metres per unit of the file."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.mesh  # noqa: B018 - raises if the file holds no valid mesh

    @cached_property
    def mesh(self) -> Mesh:
        """Mesh of the file, scaled."""
        return read_mesh("shape.file", self.file, (self.scale,))

    @property
    def faces(self) -> tuple[str, ...]:
        """Names of the faces."""
        return ("surface",)

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return self.mesh.volume

    @property
    def center(self) -> Vector:
        """Centre of mass in the object frame for uniform density [m]."""
        return triple(self.mesh.center)

    @property
    def principal_axes(self) -> Quaternion:
        """Orientation of the principal axes in the object frame, wxyz."""
        return wxyz(Rotation.from_matrix(self.mesh.axes))

    def inertia(self, mass: float) -> Vector:
        """Return the principal moments [kg m^2] about the centre of mass for uniform density."""
        return triple(mass * self.mesh.moments)

    def geoms(self, name: str, rgba: Color = COLOR) -> tuple[Geom, ...]:
        """Return one geom of the given name."""
        return (Geom(name, "mesh", (self.scale,), rgba=rgba, file=self.file),)

    def scaled(self, factor: float) -> MeshShape:
        """Return a copy with all lengths multiplied by `factor`."""
        return MeshShape(self.file, factor * self.scale)

    def _closest(self, p_O: Array) -> Place:
        point, outward = self.mesh.closest(p_O)
        return Place(triple(point), triple(-outward), "surface")

    def _place(self, face: str, u: float, v: float) -> Place:
        height = 2.0 * v - 1.0
        angle, across = 2.0 * math.pi * u, math.sqrt(1.0 - height**2)
        direction = np.array([across * math.cos(angle), across * math.sin(angle), height])
        point, outward = self.mesh.outermost(direction)
        return Place(triple(point), triple(-outward), face)
