"""Meshes of objects: reading and checking of files, queries on surface and convex hull."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array

# Formats that refer to no other file.
_FORMATS = (".obj", ".ply", ".stl")
# How many meshes are kept in memory.
_KEPT = 32


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface in the frame of its file.

    Attributes:
        vertices: Positions of the vertices [m], (v, 3).
        faces: Indices of each face's vertices, (f, 3), counter-clockwise as seen from outside.
        normals: Outward unit normals of the faces, (f, 3).
        volume: Enclosed volume [m^3].
        center: Centre of mass for uniform density [m], (3,).
        moments: Principal moments of inertia about the centre, per mass [m^2], (3,).
        axes: Principal axes as columns of a rotation matrix, (3, 3).
        hull: Planes of the convex hull as normals n and offsets d, (h, 4); n p <= d inside.
    """

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array
    volume: float
    center: Array
    moments: Array
    axes: Array
    hull: Array

    def closest(self, p: Array) -> tuple[Array, Array]:
        """Return the surface point closest to a point, and its outward normal, (3,) each."""
        import trimesh

        triangles = self.vertices[self.faces]
        points = trimesh.triangles.closest_point(triangles, np.broadcast_to(p, (len(triangles), 3)))
        distances = np.linalg.norm(points - p, axis=1)
        near = np.flatnonzero(distances <= distances.min() + 1e-12)
        # At an edge or corner take the face whose normal points most towards p.
        face = near[np.argmax(self.normals[near] @ (p - points[near[0]]))]
        return points[face], self.normals[face]

    def outermost(self, direction: Array) -> tuple[Array, Array]:
        """Return the last surface point on a ray from the centre and its outward normal, (3,) each.

        Source: Moeller and Trumbore 1997, for all triangles at once.
        """
        a, b, c = self.vertices[self.faces].swapaxes(0, 1)
        edge_1, edge_2, arm = b - a, c - a, self.center - a
        across = np.cross(direction, edge_2)
        det = np.einsum("fi,fi->f", edge_1, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("fi,fi->f", arm, across) / det
            turned = np.cross(arm, edge_1)
            v = turned @ direction / det
            far = np.einsum("fi,fi->f", edge_2, turned) / det
            # Tolerance, so that a ray through an edge or corner hits one of its triangles.
            hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9) & (far > 0.0)
        if not hit.any():  # the centre of a mesh need not be inside it
            return self.closest(self.center + direction * np.ptp(self.vertices))
        face = int(np.argmax(np.where(hit, far, -np.inf)))
        return self.center + far[face] * direction, self.normals[face]

    def inside_hull(self, p: Array) -> float:
        """Return the depth of a point inside the convex hull [m]; negative outside."""
        return float((self.hull[:, 3] - self.hull[:, :3] @ p).min())


def read_mesh(field: str, file: str, scale: tuple[float, ...]) -> Mesh:
    """Return the mesh of a file, scaled by one factor, or by one along each axis.

    Raises:
        InvalidInputError: The file is missing or unreadable, or is no closed surface with outward
            faces; names the field.
    """
    path = Path(file)
    if path.suffix.lower() not in _FORMATS:
        raise InvalidInputError(field, file, f"a file that ends in one of {', '.join(_FORMATS)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        given = f"{file} ({error.strerror})"
        raise InvalidInputError(field, given, "a mesh file that can be read") from None
    return _mesh(field, file, scale, data)


@lru_cache(_KEPT)
def _mesh(field: str, file: str, scale: tuple[float, ...], data: bytes) -> Mesh:
    import trimesh  # slow (a third of a second), and most objects have no mesh

    if not data.strip():
        raise InvalidInputError(field, f"{file}, which is empty", "a mesh file with faces")
    try:
        read: Any = trimesh.load_mesh(io.BytesIO(data), file_type=Path(file).suffix[1:].lower())
    except Exception as error:  # trimesh's readers raise errors of many types
        given = f"{file}, which cannot be read ({type(error).__name__})"
        raise InvalidInputError(field, given, "a mesh file with faces") from None
    if not isinstance(read, trimesh.Trimesh) or not len(read.faces):
        raise InvalidInputError(field, f"{file} without faces", "a mesh file with faces")
    if not np.isfinite(read.vertices).all():
        raise InvalidInputError(field, f"{file} with NaN or infinity", "finite vertices")
    read.apply_scale(scale[0] if len(scale) == 1 else scale)
    if not (read.is_watertight and read.is_winding_consistent):
        given = f"{file}, which has holes or faces turned against their neighbours"
        raise InvalidInputError(field, given, "a closed surface")
    if not read.volume > 0.0:
        given = f"{file}, which encloses {read.volume:g} m^3"
        raise InvalidInputError(field, given, "faces counter-clockwise as seen from outside")
    read.density = 1.0 / read.volume
    moments, axes = np.linalg.eigh(read.moment_inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    hull = read.convex_hull
    corners = hull.vertices[hull.faces[:, 0]]
    offsets = np.einsum("hi,hi->h", hull.face_normals, corners)
    return Mesh(
        vertices=np.array(read.vertices),
        faces=np.array(read.faces),
        normals=np.array(read.face_normals),
        volume=float(read.volume),
        center=np.array(read.center_mass),
        moments=moments,
        axes=axes,
        hull=np.column_stack([hull.face_normals, offsets]),
    )
