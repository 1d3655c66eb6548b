"""Places in a scenario file: poses, corners, directions, and files that it may read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from scenarios.file_errors import Key, Source, nearest
from sim.scenario import Geom, Pose, Quaternion, Vector
from sim.shape import Shape
from sim.shapes import Box, Cylinder
from synthesis.contact import Array

# A contact that is farther off is not on the surface [m].
ON_SURFACE = 1e-3
# Directions nearer to z than this take x as their tangent [-].
_STEEP = 0.9
_ROUNDING = 1e-12


class Turned(Protocol):
    """What has an orientation."""

    @property
    def rpy_deg(self) -> list[float] | None:
        """Roll, pitch, yaw [deg]."""

    @property
    def quaternion(self) -> list[float] | None:
        """Quaternion wxyz."""


def vector(values: Sequence[float] | Array) -> Vector:
    """Three numbers, without negative zeros."""
    x, y, z = (float(value) + 0.0 for value in values)
    return (x, y, z)


def direction(values: Sequence[float] | Array) -> Vector:
    """A direction of length 1, without what rounding left of components that are 0."""
    x, y, z = (float(value) if abs(value) > _ROUNDING else 0.0 for value in values)
    return (x, y, z)


def turn(rpy_deg: list[float] | None) -> Quaternion:
    """Quaternion wxyz of roll, pitch and yaw about fixed axes [deg]."""
    if rpy_deg is None:
        return (1.0, 0.0, 0.0, 0.0)
    w, x, y, z = Rotation.from_euler("xyz", rpy_deg, degrees=True).as_quat(scalar_first=True)
    return (float(w), float(x) + 0.0, float(y) + 0.0, float(z) + 0.0)


def orientation(source: Source, key: Key, given: Turned) -> Quaternion:
    """The orientation that a table gives in one of two ways.

    Raises:
        FileError: It gives both.
    """
    if given.quaternion is None:
        return turn(given.rpy_deg)
    if given.rpy_deg is not None:
        raise source.error((*key, "rpy_deg"), given.rpy_deg, "rpy_deg or quaternion, not both")
    w, x, y, z = given.quaternion
    return (w, x, y, z)


def only_one(source: Source, key: Key, options: Mapping[str, object]) -> None:
    """Checks that exactly one of several keys is given.

    Raises:
        FileError: None is, or several are.
    """
    given = [name for name, value in options.items() if value is not None]
    if len(given) != 1:
        key = (*key, given[1]) if given else key
        valid = f"exactly one of {', '.join(options)}"
        raise source.error(key, " and ".join(given) or "none of them", valid)


def apply(pose: Pose, p: Vector) -> Array:
    """A point of a frame with that pose, in the parent frame, (3,)."""
    return np.asarray(pose.position) + _rotation(pose).apply(p)


def undo(pose: Pose, p: Array) -> Array:
    """A point of the parent frame in the frame with that pose, (3,)."""
    return _rotation(pose).inv().apply(p - np.asarray(pose.position))


def turned(pose: Pose, direction: Array) -> Array:
    """A direction of a frame with that pose, in the parent frame, (3,)."""
    return _rotation(pose).apply(direction)


def _rotation(pose: Pose) -> Rotation:
    return Rotation.from_quat(pose.quaternion, scalar_first=True)


def corner(size: Vector, name: str) -> Vector:
    """The corner of a box of that size [m] with a name like "-x +y -z"."""
    signs = [name[name.index(axis) - 1] for axis in "xyz"]
    x, y, z = (
        length / 2 if sign == "+" else -length / 2 for sign, length in zip(signs, size, strict=True)
    )
    return (x, y, z)


def across(normal: Vector) -> Vector:
    """A unit vector across a unit normal: z as far as it is across, or x where the normal is z."""
    n = np.asarray(normal)
    towards = np.array([0.0, 0.0, 1.0]) if abs(n[2]) < _STEEP else np.array([1.0, 0.0, 0.0])
    tangent = towards - n.dot(towards) * n
    return direction(tangent / np.linalg.norm(tangent))


def surface_normal(geom: Geom, front: Vector, p_W: Array) -> tuple[Array, Array]:
    """The place on a fixed surface that a point is at, or should be, and its normal, outwards.

    Args:
        geom: A plane, a box or a cylinder.
        front: Outward normal of its front, in its own axes: preferred where the point is on it.
        p_W: The point in the world [m], (3,).

    Returns:
        Both in the world, (3,).
    """
    p = undo(geom.pose, p_W)
    if geom.kind == "plane":
        return apply(geom.pose, vector([p[0], p[1], 0.0])), turned(geom.pose, np.array(front))
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
    return apply(geom.pose, vector(point)), turned(geom.pose, normal)


class Places:
    """Where a scenario file may read: its own folder, and what the command line allows."""

    def __init__(self, source: Source, allowed: tuple[Path, ...]) -> None:
        self._source, self._folder = source, source.file.absolute().parent
        self._allowed = tuple(folder.resolve() for folder in (self._folder, *allowed))

    def file(self, key: Key, given: str, what: str) -> Path:
        """The file that a key names, relative to the scenario file.

        Raises:
            FileError: It is elsewhere, or there is none.
        """
        path = Path(given)
        try:
            found = (self._folder / path).resolve()
            inside = any(found.is_relative_to(folder) for folder in self._allowed)
            plain = ".." not in path.parts and not path.is_absolute()
            exists = inside and found.is_file()
        except (OSError, ValueError):  # a name that is too long, or has a zero in it
            raise self._source.error(key, given, what) from None
        if not inside or (not plain and len(self._allowed) == 1):
            valid = f"{what} in or below {self._source.file.parent}, or in a folder given with "
            raise self._source.error(key, given, f"{valid}--allow-path")
        if not exists:
            raise self._source.error(key, given, f"{what} that exists")
        return found

    def model(self, key: Key, given: str, shipped: tuple[str, ...], what: str) -> str:
        """A model that ships, by its name, or the path of the file that a key names.

        Raises:
            FileError: There is neither.
        """
        if given in shipped:
            return given
        if "." not in given and "/" not in given:
            valid = f"{nearest(given, list(shipped))}; or {what}"
            raise self._source.error(key, f'"{given}"', valid)
        return str(self.file(key, given, what))
