"""Mesh files of a robot as light meshes: decimated, shaded and coloured triangles."""

from __future__ import annotations

from pathlib import Path

import fast_simplification
import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual import TextureVisuals

from fulcrum.assets.packages import ModelError

FACES_PER_MESH = 7_000
"""Target of triangles per mesh file; long open borders need more. The pedestal had 74,707."""
AGGRESSION = 3.0
"""Decimation setting, 0 to 10: at 5 the torso has a spike of 29 mm, at 3 the worst is 1.4 mm."""
DARKEST = 30
"""Least value of a colour channel: the official black (3, 3, 3) would show no shading."""
UNPAINTED = (0.7, 0.7, 0.7, 1.0)
"""Colour [0, 1] of a part without a colour."""
CREASE = 0.6
"""Edges sharper than this [rad] stay sharp in the shading."""


def read_mesh(file: Path, scale: tuple[float, ...]) -> list[trimesh.Trimesh]:
    """Return the parts of a mesh file, one per material, in the mesh frame [m].

    The COLLADA unit is used. The up axis is ignored, as in RViz: ROS meshes are in link axes
    whatever they declare (the Y_UP torso matches its Z_UP collision mesh without rotation).

    Raises:
        ModelError: The file has no mesh that can be read.
    """
    try:
        scene = trimesh.load_scene(file)
    except Exception as error:  # each reader of trimesh raises its own errors
        given = f"file {file.name} ({type(error).__name__}: {error})"
        raise ModelError(given, "a mesh file that trimesh reads") from None
    to_metres = trimesh.units.unit_conversion(scene.units or "meters", "meters")
    parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    for part in parts:
        part.apply_scale(np.multiply(scale, to_metres))
    if not parts:
        raise ModelError(f"file {file.name}, which holds no mesh", "a file with triangles")
    return parts


def light_mesh(
    file: Path, scale: tuple[float, ...], fallback: tuple[float, ...] | None
) -> list[NDArray]:
    """Return vertices, faces, normals and colours of a mesh file, with about the target's faces."""
    parts = read_mesh(file, scale)
    keep = FACES_PER_MESH / sum(len(part.faces) for part in parts)
    # Vertices are split at creases, so that vertex normals shade the part well.
    light = [trimesh.graph.smooth_shade(_decimated(part, keep), angle=CREASE) for part in parts]
    rgba = [_part_rgba(part, fallback) for part in parts]
    sizes = [len(part.vertices) for part in light]
    starts = np.cumsum([0, *sizes[:-1]])
    faces = [part.faces + start for part, start in zip(light, starts, strict=True)]
    return [
        np.vstack([part.vertices for part in light]).astype(np.float32),
        np.vstack(faces).astype(np.uint32),
        np.vstack([part.vertex_normals for part in light]).astype(np.float32),
        np.repeat(np.array(rgba, np.uint8), sizes, axis=0),
    ]


def _decimated(part: trimesh.Trimesh, keep: float) -> trimesh.Trimesh:
    """Return the part with closed seams and the fraction `keep` of its faces."""
    vertices, inverse = np.unique(np.round(part.vertices, 6), axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[part.faces]
    if keep < 1.0:
        # An open border is often the only edge of a flat sheet, as in half of the pedestal.
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


def _part_rgba(part: trimesh.Trimesh, fallback: tuple[float, ...] | None) -> NDArray[np.uint8]:
    """Return the COLLADA diffuse colour, else the URDF's colour, else light grey."""
    if isinstance(part.visual, TextureVisuals):
        rgba = part.visual.material.main_color
    else:
        rgba = np.round(255 * np.array(fallback or UNPAINTED))
    return np.maximum(rgba, DARKEST).astype(np.uint8)
