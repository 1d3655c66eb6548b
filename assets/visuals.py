"""The look of a robot for the recorder: one light, coloured triangle mesh per link."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache

import fast_simplification
import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual import TextureVisuals

from assets import description_path

MESH_URI = "package://example-robot-data/robots/"
FACES_PER_MESH = 7_000
"""Triangle goal for one mesh file, missed where open borders are long; the pedestal had 74,707."""
AGGRESSION = 3.0
"""Of the decimation, 0 to 10: at 5 the torso grows a spike of 29 mm, at 3 the worst is 1.4 mm."""
DARKEST = 30
"""Colour channels are raised to this: the official black (3, 3, 3) shows no shading at all."""
UNPAINTED = (0.7, 0.7, 0.7, 1.0)
"""Colour [0, 1] of what has none."""
CREASE = 0.6
"""Edges sharper than this [rad] stay sharp in the shading."""


@dataclass(frozen=True)
class Visual:
    """The visual mesh of one link.

    Attributes:
        link: Name of the link, which is also the name of its body in MJCF.
        X_LM: (4, 4) pose of the mesh in the link [m].
        vertices: (n, 3) float32, in the mesh frame [m].
        faces: (m, 3) uint32 indices of vertices, counter-clockwise seen from outside.
        normals: (n, 3) float32 unit vectors.
        colors: (n, 4) uint8 sRGB and opacity.
    """

    link: str
    X_LM: NDArray[np.float64]
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]

    @property
    def nbytes(self) -> int:
        """Size of the arrays [bytes], which is what a recording pays."""
        arrays = (self.vertices, self.faces, self.normals, self.colors)
        return sum(array.nbytes for array in arrays)


def load_visuals(urdf: str, links: Collection[str] | None = None) -> list[Visual]:
    """Visual meshes of all links that have one, in the order of the URDF.

    Args:
        urdf: Text of the URDF, such as `assets.from_urdf.baxter_urdf()` returns.
        links: Names of the links that are wanted; None for all.

    Raises:
        ValueError: If a mesh lies outside the installed descriptions.
        FileNotFoundError: If a mesh file is missing.
    """
    visuals = []
    for link in ET.fromstring(urdf).iter("link"):
        if links is not None and link.attrib["name"] not in links:
            continue
        for visual in link.iter("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            arrays = _light_mesh(mesh.attrib["filename"], scale_of(mesh), rgba_of(visual))
            visuals.append(Visual(link.attrib["name"], pose_of(visual), *arrays))
    return visuals


def pose_of(element: ET.Element) -> NDArray[np.float64]:
    """(4, 4) pose [m] in its `<origin>`: fixed-axis roll, pitch, yaw; identity without one."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
    pose = trimesh.transformations.euler_matrix(roll, pitch, yaw, "sxyz")
    pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return pose


def rgba_of(element: ET.Element) -> tuple[float, ...] | None:
    """Colour in [0, 1] of the `<material>` below a link or visual; None if there is none."""
    color = element.find(".//material/color")
    return None if color is None else tuple(_numbers(color.attrib["rgba"]))


def scale_of(mesh: ET.Element) -> tuple[float, ...]:
    """The three scale factors of a URDF `<mesh>`."""
    return tuple(_numbers(mesh.get("scale", "1 1 1")))


def read_mesh(uri: str, scale: tuple[float, ...]) -> list[trimesh.Trimesh]:
    """Parts of a mesh file, one per material, in the mesh frame [m].

    The COLLADA unit is honoured. Its up axis is not, as in RViz: ROS meshes are in link axes
    whatever they declare (the torso, which says Y_UP, matches its Z_UP collision mesh unrotated).

    Raises:
        ValueError: If the URI does not point into the installed descriptions.
        FileNotFoundError: If the file is missing.
    """
    if not uri.startswith(MESH_URI):
        raise ValueError(f"mesh: got {uri!r}; valid starts with {MESH_URI}.")
    scene = trimesh.load_scene(description_path(uri.removeprefix(MESH_URI)))
    to_metres = trimesh.units.unit_conversion(scene.units or "meters", "meters")
    parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    for part in parts:
        part.apply_scale(np.multiply(scale, to_metres))
    return parts


@cache
def _light_mesh(
    uri: str, scale: tuple[float, ...], fallback: tuple[float, ...] | None
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Vertices, faces, normals and colours of a mesh file within the triangle budget."""
    parts = read_mesh(uri, scale)
    keep = FACES_PER_MESH / sum(len(part.faces) for part in parts)
    light = [_shaded(_decimated(part, keep)) for part in parts]
    rgba = [_part_rgba(part, fallback) for part in parts]
    sizes = [len(part.vertices) for part in light]
    starts = np.cumsum([0, *sizes[:-1]])
    faces = [part.faces + start for part, start in zip(light, starts, strict=True)]
    return (
        np.vstack([part.vertices for part in light]).astype(np.float32),
        np.vstack(faces).astype(np.uint32),
        np.vstack([part.vertex_normals for part in light]).astype(np.float32),
        np.repeat(np.array(rgba, np.uint8), sizes, axis=0),
    )


def _decimated(part: trimesh.Trimesh, keep: float) -> trimesh.Trimesh:
    """The part with its seams closed and the fraction `keep` of its faces left."""
    vertices, inverse = np.unique(np.round(part.vertices, 6), axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[part.faces]
    if keep < 1.0:
        # An open border is often the only edge of a flat sheet: without it half the pedestal goes.
        vertices, faces = fast_simplification.simplify(
            vertices,
            faces.astype(np.int32),
            target_reduction=1.0 - keep,
            agg=AGGRESSION,
            preserve_border=True,
        )
    light = trimesh.Trimesh(vertices, faces, process=False)
    light.update_faces(light.nondegenerate_faces() & light.unique_faces())
    return light


def _shaded(part: trimesh.Trimesh) -> trimesh.Trimesh:
    """The part with its vertices split at creases, so that vertex normals shade it well."""
    return trimesh.graph.smooth_shade(part, angle=CREASE)


def _part_rgba(part: trimesh.Trimesh, fallback: tuple[float, ...] | None) -> NDArray[np.uint8]:
    """The COLLADA diffuse colour; without a material the URDF's, and without that light grey."""
    if isinstance(part.visual, TextureVisuals):
        rgba = part.visual.material.main_color
    else:
        rgba = np.round(255 * np.array(fallback or UNPAINTED))
    return np.maximum(rgba, DARKEST).astype(np.uint8)


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]
