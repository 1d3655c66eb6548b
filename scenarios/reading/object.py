"""Makes object and fixed surfaces of a file's tables; raises FileError where they are wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fulcrum.scenarios.reading.access import Access
from fulcrum.scenarios.reading.places import corner, only_one, orientation, vector
from fulcrum.scenarios.reading.source import KeyPath, Source
from fulcrum.scenarios.schema.derive import instance
from fulcrum.scenarios.schema.tables import SHAPES, AnyObject, ContactTable, SurfaceTable
from fulcrum.sim.geometry import GRAVITY, Geom, Object, Pose, Shape, homogeneous
from fulcrum.sim.geometry.shapes import Box, MeshShape
from fulcrum.sim.scenario import ContactMaterial
from fulcrum.synthesis.arrays import Vector

# Spacing of the lines with which MuJoCo draws a plane [m].
_GRID = 0.05


@dataclass(frozen=True)
class Thing:
    """Shape and pose of the object, for contacts and path.

    Attributes:
        source: Scenario file.
        name: Name of the object.
        shape: Shape of the object.
        start: Pose of the object at the start.
    """

    source: Source
    name: str
    shape: Shape
    start: Pose

    @property
    def resting(self) -> str:
        """Name of the geom that touches the environment."""
        return self.shape.resting or self.name

    def corner(self, key: KeyPath, name: str) -> Vector:
        """Return a corner in the object frame [m]."""
        if not isinstance(self.shape, Box):
            points = "point_m and axis" if "edge" in key else "a point_m"
            raise self.source.error(key, f'"{name}"', f"{points}, as only a box has corners")
        return corner(self.shape.size, name)


def make_thing(source: Source, table: AnyObject, access: Access) -> Thing:
    """Return the object's shape and pose."""
    start = Pose(vector(table.position_m), orientation(source, ("object",), table))
    with source.at(("object",)):
        return Thing(source, table.name, _shape(table, access), start)


def _shape(table: AnyObject, access: Access) -> Shape:
    shape = SHAPES[table.shape]
    if shape is not MeshShape:
        return instance(shape, table)
    given = table.model_dump()["file"]
    mesh = access.file(("object", "file"), given, "a mesh file (STL, OBJ or PLY)")
    return instance(shape, table, file=str(mesh))


def make_object(thing: Thing, table: AnyObject) -> Object:
    """Return the object with its mass."""
    key: KeyPath = ("object",)
    names = ("weight_n", "mass_kg", "density_kg_per_m3")
    only_one(thing.source, key, {name: getattr(table, name) for name in names})
    if table.weight_n is not None:
        mass = table.weight_n / GRAVITY
    elif table.mass_kg is not None:
        mass = table.mass_kg
    else:
        assert table.density_kg_per_m3 is not None
        mass = table.density_kg_per_m3 * thing.shape.volume
    with thing.source.at(key):
        made = homogeneous(thing.name, thing.shape, mass, colour(table.rgba))
        if table.center_of_mass_m is not None:
            made = replace(made, center_of_mass=vector(table.center_of_mass_m))
        if table.inertia_kg_m2 is not None:
            axes, moments = Pose().quaternion, vector(table.inertia_kg_m2)
            made = replace(made, inertia=moments, principal_axes=axes)
        return made


def make_surface(source: Source, name: str, surface: SurfaceTable) -> Geom:
    """Return the geom of a fixed surface."""
    key: KeyPath = ("environment", name)
    quaternion = orientation(source, key, surface)
    at, size = np.asarray(surface.position_m), surface.size_m
    count = 2 if surface.kind in ("floor", "post") else 3
    if len(size) != count:
        raise source.error((*key, "size_m"), size, f"{count} lengths of a {surface.kind}")
    if surface.facing is not None and surface.kind != "wall":
        valid = "left out, as only a wall has a front"
        raise source.error((*key, "facing"), surface.facing, valid)
    rgba = colour(surface.rgba)
    if surface.kind == "floor":
        half = (size[0] / 2, size[1] / 2, _GRID)
        return Geom(name, "plane", half, Pose(vector(at), quaternion), rgba, surface.solid)
    half_sizes = tuple(length / 2 for length in size)
    lengths = (size[0], *size) if surface.kind == "post" else size
    behind = -np.asarray(front(surface)) * lengths / 2
    pose = Pose(vector(Pose(vector(at), quaternion).in_parent(vector(behind))), quaternion)
    kind = "cylinder" if surface.kind == "post" else "box"
    return Geom(name, kind, half_sizes, pose, rgba, surface.solid)


def front(surface: SurfaceTable) -> Vector:
    """Return the outward normal of a surface's front, in its own axes."""
    if surface.kind != "wall":
        return (0.0, 0.0, 1.0)
    facing = surface.facing or "-x"
    x, y, z = (float(facing == f"+{axis}") - float(facing == f"-{axis}") for axis in "xyz")
    return (x, y, z)


def material(
    source: Source, key: KeyPath, table: ContactTable | None, usual: ContactMaterial
) -> ContactMaterial:
    """Return stiffness and damping of a contact; the usual ones where they are not given."""
    if table is None:
        return usual
    ball = {n: getattr(table, n) for n in ("youngs_modulus_pa", "radius_m", "load_n")}
    given = [name for name, value in ball.items() if value is not None]
    damping_s = usual.damping_s if table.damping_s is None else table.damping_s
    if not given:
        stiffness = table.stiffness_n_per_m or usual.stiffness
        return ContactMaterial(stiffness, damping_s)
    if table.stiffness_n_per_m is not None:
        valid = f"left out where there is {given[0]}"
        raise source.error((*key, "stiffness_n_per_m"), table.stiffness_n_per_m, valid)
    for name, value in ball.items():
        if value is None:
            raise source.error((*key, given[0]), ball[given[0]], f"together with {name}")
    assert table.youngs_modulus_pa and table.radius_m and table.load_n
    with source.at(key):
        return ContactMaterial.hertz(
            table.youngs_modulus_pa, table.radius_m, table.load_n, damping_s, table.poisson_ratio
        )


def colour(values: list[float]) -> tuple[float, float, float, float]:
    """Return red, green, blue and opacity."""
    r, g, b, a = values
    return (r, g, b, a)
