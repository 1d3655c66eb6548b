"""Contact geometries in Drake's plant: pads on faces, points of the object on surfaces, links.

Drake has no contact with torsional friction. So a pad replaces the ball of a hand: a ring of
points at the torsion radius, which carries a moment of mu e_n per newton about the normal. It is
on two hinges in the face, so it carries no other moment; it touches a plane on the object's face.
Corners and rims of the object are spheres of 0.1 mm around the exact points. The surfaces that
they touch are lowered by the same length, so that points touch planes without rounded edges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, TypeAlias

import mujoco
import numpy as np
from pydrake import geometry
from pydrake.common import MemoryFile
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from scipy.spatial import ConvexHull

from fulcrum.sim.geometry import Geom, read_mesh
from fulcrum.sim.model import contact_axes, tip_geom, tip_site
from fulcrum.sim.plant.drake_model import Bodies, Mount, pose
from fulcrum.sim.scenario import SUPPORT, ContactMaterial, Friction, Rest, Scenario, Support
from fulcrum.synthesis.arrays import Array

# Radius of the spheres that represent points [m].
_POINT = 1e-4
# Points on the rim of a cylinder's end; a multiple of four gives exact points on the axes.
_RIM = 64
# Points of a hand's pad. In SAP a point creeps in proportion to its force over its effective mass:
# on a long lever more points creep less (0.11 mm of slip with four at 0.5 m).
_RING, _WIDE_RING = 4, 8
_WIDE = 0.05  # [m]
# Margin by which the plane that a pad touches extends beyond the pad [m].
_FACE = 0.2
# Half the width of the plate that represents an infinite plane [m].
_PLANE = 10.0
# A point belongs to the environment contact within this distance [m].
_SAME_POINT = 0.01
# Friction of unwanted contacts [-].
_UNWANTED = Friction(0.5)


Posed: TypeAlias = tuple[geometry.Shape, RigidTransform]


class Contacts:
    """All contact geometries, registered in a plant that is not yet finalised.

    Attributes:
        wanted: Index of the scenario's contact for each geometry of hands and object that may
            touch; -1 for a rest.
        names: Name of the scene's geom for each geometry that must not touch.
        object_ids: Geometries of the object.
        tips: Places of the hands' tips.
        pads: Positions of the pads in the axes of the tips [m].
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scenario: Scenario,
        scene: mujoco.MjModel,
        bodies: Bodies,
    ) -> None:
        self._plant, self._scenario, self._scene = plant, scenario, scene
        self._bodies = bodies
        self._thing = bodies.place(scene.body(scenario.object.name).id, np.zeros(3), _UNTURNED)
        self._geoms = {geom.name: geom for geom in (*scenario.object.geoms, *scenario.environment)}
        self.wanted: dict[GeometryId, int] = {}
        self.names: dict[GeometryId, str] = {}
        self.object_ids: set[GeometryId] = set()
        self.tips: list[Mount] = []
        self.pads: list[Array] = []
        self._ids: list[GeometryId] = []
        # Sets of geometries that may touch each other.
        self._allowed: list[tuple[list[GeometryId], list[GeometryId]]] = []
        for i in range(len(scenario.hands)):
            self._add_pad(i)
        self._add_supports()
        self._add_unwanted()

    def filters(self) -> list[CollisionFilterDeclaration]:
        """Return the collision filters, to be applied in order."""
        every = GeometrySet(self._ids)
        filters = [CollisionFilterDeclaration().ExcludeWithin(every)]
        for first, second in self._allowed:
            between = GeometrySet(first), GeometrySet(second)
            filters.append(CollisionFilterDeclaration().AllowBetween(*between))
        return filters

    def _add_pad(self, i: int) -> None:
        """Add the ring of points of hand i, and the plane that it touches."""
        hand, scene = self._scenario.hands[i], self._scene
        site, tip = scene.site(tip_site(hand)), scene.geom(tip_geom(hand))
        place = self._bodies.place(int(site.bodyid[0]), site.pos, site.quat)
        self.tips.append(place)
        self.pads.append(np.array([0.0, 0.0, tip.size[0]]))
        radius = hand.friction.e_n or 0.0
        count = (_WIDE_RING if radius > _WIDE else _RING) if radius else 1
        angles = 2.0 * np.pi * np.arange(count) / count
        points = radius * np.array([np.cos(angles), np.sin(angles), 0.0 * angles]).T
        share = ContactMaterial(hand.material.stiffness / count, hand.material.damping_s)
        at = place.X_BG @ RigidTransform([0.0, 0.0, float(tip.size[0])])
        pad = self._bodies.add_pad(hand.name, Mount(place.body, at))
        ring = [
            self._add(
                pad,
                RigidTransform(point),
                geometry.Sphere(_POINT),
                f"{hand.name}/{j}",
                hand.friction,
                share,
            )
            for j, point in enumerate(points)
        ]
        R_OC = contact_axes(hand.normal_O, hand.tangent_O)
        outward = RotationMatrix(R_OC @ np.diag([1.0, -1.0, -1.0]))
        p_OF = np.asarray(hand.p_OC_O) + _POINT * np.asarray(hand.normal_O)
        reach = radius + _FACE
        slab, X_FS = _slab(reach, reach)
        X_OS = RigidTransform(outward, p_OF) @ X_FS
        face = self._add(self._thing.body, X_OS, slab, f"{hand.name}/face", hand.friction, share)
        self.object_ids.add(face)
        for point in ring:
            self.wanted[point] = i
        self._allowed.append((ring, [face]))

    def _add_supports(self) -> None:
        """Add the object's points for each pair of its geoms and surfaces that may touch."""
        scenario = self._scenario
        pairs: dict[tuple[str, str], Support | Rest] = {}
        touched: list[Support | Rest] = [*scenario.supports, *scenario.rests]
        for touching in touched:
            pairs.setdefault((touching.geom, touching.surface), touching)
        for (name, surface), touching in pairs.items():
            of = touching.friction, touching.material
            known = [
                (len(scenario.hands) + i, np.asarray(support.p_OP_O))
                for i, support in enumerate(scenario.supports)
                if (support.geom, support.surface) == (name, surface)
            ]
            shape, X_WS = _solid(self._geoms[surface], _POINT)
            world, label = self._plant.world_body(), f"{surface}/{name}"
            below = self._add(world, X_WS, shape, label, *of)
            ids, near = [], _reach(self._geoms[name])
            for j, (shape, X_OP) in enumerate(_points(self._geoms[name])):
                label = f"{name}/{surface}/{j}"
                point = self._add(self._thing.body, X_OP, shape, label, *of)
                distances = {i: np.linalg.norm(X_OP.translation() - at) for i, at in known}
                nearest = min(distances, key=lambda i: distances[i], default=-1)
                close = distances.get(nearest, np.inf) < near
                self.wanted[point] = nearest if close else -1
                self.object_ids.add(point)
                ids.append(point)
            self._allowed.append((ids, [below]))

    def _add_unwanted(self) -> None:
        """Add the geometries that must not touch: those of the scene's pairs without a name."""
        scene, ids = self._scene, dict[int, GeometryId]()
        for pair in (i for i in range(scene.npair) if not scene.pair(i).name):
            both = int(scene.pair_geom1[pair]), int(scene.pair_geom2[pair])
            for index in both:
                if index not in ids:
                    ids[index] = self._add_unwanted_geom(scene.geom(index))
            self._allowed.append(([ids[both[0]]], [ids[both[1]]]))

    def _add_unwanted_geom(self, geom: Any) -> GeometryId:
        place = self._bodies.place(int(geom.bodyid[0]), geom.pos, geom.quat)
        shape, X_GS = self._compiled(geom)
        own = self._add(place.body, place.X_BG @ X_GS, shape, geom.name, _UNWANTED, SUPPORT)
        self.names[own] = geom.name
        if place.body.index() == self._thing.body.index():
            self.object_ids.add(own)
        return own

    def _compiled(self, geom: Any) -> Posed:
        """Return the shape and pose of one of the compiled scene's geoms."""
        if geom.type[0] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = self._scene.mesh(int(geom.dataid[0]))
            first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            return _hull(geom.name, self._scene.mesh_vert[first : first + count])
        kind = mujoco.mjtGeom(int(geom.type[0])).name.removeprefix("mjGEOM_").lower()
        return _primitive(kind, geom.size.tolist())

    def _add(
        self,
        body: RigidBody,
        X_BG: RigidTransform,
        shape: geometry.Shape,
        name: str,
        friction: Friction,
        material: ContactMaterial,
    ) -> GeometryId:
        """Register a geometry; both of a pair have the pair's material, so each yields half."""
        properties = geometry.ProximityProperties()
        geometry.AddContactMaterial(
            dissipation=0.0,
            point_stiffness=2.0 * material.stiffness,
            friction=CoulombFriction(friction.mu, friction.mu),
            properties=properties,
        )
        properties.AddProperty("material", "relaxation_time", material.damping_s / 2.0)
        own = self._plant.RegisterCollisionGeometry(body, X_BG, shape, name, properties)
        self._ids.append(own)
        return own


_UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])


def _solid(geom: Geom, less: float = 0.0) -> Posed:
    """Return a geom's shape, with all faces moved inwards by `less` [m], and its pose."""
    X_OG = pose(np.asarray(geom.pose.position), np.asarray(geom.pose.quaternion))
    if geom.file is not None:
        vertices = read_mesh(f"{geom.name}.file", geom.file, geom.size).vertices
        shape, X_GS = _hull(geom.name, vertices)
    elif geom.kind == "plane":
        shape, X_GS = _slab(_PLANE, _PLANE / 10.0)
        X_GS = RigidTransform([0.0, 0.0, -less]) @ X_GS
    else:
        shape, X_GS = _primitive(geom.kind, [size - less for size in geom.size])
    return shape, X_OG @ X_GS


def _slab(half: float, depth: float) -> Posed:
    """Return a square plate below the plane z = 0, since Drake's half-spaces cannot move."""
    return geometry.Box(2.0 * half, 2.0 * half, depth), RigidTransform([0.0, 0.0, -depth / 2.0])


def _primitive(kind: str, size: list[float]) -> Posed:
    """Return the shape of a MuJoCo geom from its kind and size."""
    if kind == "plane":
        return _slab(_PLANE, _PLANE / 10.0)
    shapes: dict[str, Callable[..., geometry.Shape]] = {
        "sphere": lambda radius, *_: geometry.Sphere(radius),
        "capsule": lambda radius, half, *_: geometry.Capsule(radius, 2.0 * half),
        "cylinder": lambda radius, half, *_: geometry.Cylinder(radius, 2.0 * half),
        "ellipsoid": geometry.Ellipsoid,
        "box": lambda *halves: geometry.Box(*(2.0 * half for half in halves)),
    }
    return shapes[kind](*size), RigidTransform()


def _hull(name: str, vertices: Array) -> Posed:
    """Return the convex hull of points [m], (k, 3)."""
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in vertices.tolist()]
    lines += [f"f {i} {i + 1} {i + 2}" for i in range(1, len(lines) - 1)]
    file = MemoryFile("\n".join([*lines, ""]), ".obj", name)
    return geometry.Convex(geometry.InMemoryMesh(mesh_file=file), 1.0), RigidTransform()


def _reach(geom: Geom) -> float:
    """Return the distance [m] within which a point belongs to an environment contact.

    A rim that comes to stand touches along an arc of up to a quarter of it on either side.
    """
    return 1.4 * geom.size[0] if geom.kind == "cylinder" else _SAME_POINT


def _points(geom: Geom) -> Iterator[Posed]:
    """Yield the shapes with which a geom of the object touches surfaces, in the object frame."""
    if geom.kind == "box":
        places = np.array(list(product((-1.0, 1.0), repeat=3))) * geom.size
    elif geom.kind == "cylinder":
        angles, half = 2.0 * np.pi * np.arange(_RIM) / _RIM, geom.size[1]
        rim = geom.size[0] * np.array([np.cos(angles), np.sin(angles)]).T
        places = np.array([[*p, end] for p, end in product(rim, (-half, half))])
    elif geom.file is not None:
        vertices = read_mesh(f"{geom.name}.file", geom.file, geom.size).vertices
        places = vertices[ConvexHull(vertices).vertices]
    else:  # spheres and other round shapes
        yield _solid(geom, -_POINT)
        return
    X_OG = pose(np.asarray(geom.pose.position), np.asarray(geom.pose.quaternion))
    for place in places:
        yield geometry.Sphere(_POINT), X_OG @ RigidTransform(place)
