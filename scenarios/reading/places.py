"""Poses, corners, directions and surface points of scenario files; raises FileError if wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.scenarios.reading.source import KeyPath, Source
from fulcrum.scenarios.schema.kinds import Placed
from fulcrum.sim.geometry import Geom, Quaternion, Shape, wxyz
from fulcrum.sim.geometry.shapes import Box, Cylinder
from fulcrum.sim.model import across
from fulcrum.synthesis.arrays import Array, Vector

# Largest distance from its surface at which a point counts as on it [m].
ON_SURFACE = 1e-3
# Normals with a larger z component than this take x as their tangent [-].
_STEEP = 0.9
_ROUNDING = 1e-12


def vector(values: Sequence[float] | Array) -> Vector:
    """Return three numbers, without negative zeros."""
    x, y, z = (float(value) + 0.0 for value in values)
    return (x, y, z)


def direction(values: Sequence[float] | Array) -> Vector:
    """Return a direction of length 1 whose components are 0 instead of rounding errors."""
    x, y, z = (float(value) if abs(value) > _ROUNDING else 0.0 for value in values)
    return (x, y, z)


def turn(rpy_deg: list[float] | None) -> Quaternion:
    """Return the quaternion wxyz of roll, pitch and yaw about fixed axes [deg]."""
    if rpy_deg is None:
        return (1.0, 0.0, 0.0, 0.0)
    w, x, y, z = wxyz(Rotation.from_euler("xyz", rpy_deg, degrees=True))
    return (w, x + 0.0, y + 0.0, z + 0.0)


def orientation(source: Source, key: KeyPath, given: Placed) -> Quaternion:
    """Return the orientation that a table gives in one of two ways."""
    if given.quaternion is None:
        return turn(given.rpy_deg)
    if given.rpy_deg is not None:
        raise source.error((*key, "rpy_deg"), given.rpy_deg, "rpy_deg or quaternion, not both")
    w, x, y, z = given.quaternion
    return (w, x, y, z)


def only_one(source: Source, key: KeyPath, options: Mapping[str, object]) -> None:
    """Check that exactly one of several keys is given."""
    given = [name for name, value in options.items() if value is not None]
    if len(given) != 1:
        key = (*key, given[1]) if given else key
        valid = f"exactly one of {', '.join(options)}"
        raise source.error(key, " and ".join(given) or "none of them", valid)


def corner(size: Vector, name: str) -> Vector:
    """Return the corner of a box of that size [m] with a name like "-x +y -z"."""
    signs = [name[name.index(axis) - 1] for axis in "xyz"]
    x, y, z = (
        length / 2 if sign == "+" else -length / 2 for sign, length in zip(signs, size, strict=True)
    )
    return (x, y, z)


def usual_tangent(normal: Vector) -> Vector:
    """Return the part of z, or of x where the normal is along z, across a unit normal."""
    steep = abs(normal[2]) >= _STEEP
    towards = np.array([1.0, 0.0, 0.0]) if steep else np.array([0.0, 0.0, 1.0])
    return direction(across(towards, np.asarray(normal)))


def surface_normal(geom: Geom, front: Vector, p_W: Array) -> tuple[Array, Array]:
    """Return the point of a fixed surface that is nearest to a point, and the outward normal.

    Args:
        geom: A plane, a box or a cylinder.
        front: Outward normal of its front, in its own axes: preferred where the point is on it.
        p_W: The point in the world [m], (3,).

    Returns:
        Both in the world, (3,).
    """
    p = geom.pose.in_frame(p_W)
    if geom.kind == "plane":
        return geom.pose.in_parent(vector([p[0], p[1], 0.0])), geom.pose.rotation.apply(front)
    shape: Shape
    if geom.kind == "cylinder":
        radius, half_length = geom.size
        shape, extent = Cylinder(radius, 2.0 * half_length), (radius, radius, half_length)
    else:
        shape = Box(vector([2.0 * half for half in geom.size]))
        extent = vector(geom.size)
    place = shape.closest(vector(p))
    point, normal = np.asarray(place.point), -np.asarray(place.normal)
    n = np.asarray(front)
    in_front = np.clip(p, -np.asarray(extent), extent)
    in_front += (np.abs(n).dot(extent) - n.dot(in_front)) * n
    # On an edge, or off the surface, it is the front that counts.
    if math.dist(p, point) > ON_SURFACE or math.dist(p, in_front) < ON_SURFACE:
        point, normal = in_front, n
    return geom.pose.in_parent(vector(point)), geom.pose.rotation.apply(normal)
