"""Visual meshes of a robot for the recorder: light, coloured triangle meshes of the links."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fulcrum.assets.cache import cached
from fulcrum.assets.packages import named_file

# Packages that read mesh files: another version of one invalidates the cache.
_MESH_READERS = ("fast-simplification", "pycollada", "trimesh")


@dataclass(frozen=True)
class Visual:
    """The visual mesh of one link.

    Attributes:
        link: Name of the link, and of its body in MJCF.
        X_LM: Pose of the mesh in the link [m], (4, 4).
        vertices: Vertices in the mesh frame [m], (n, 3).
        faces: Indices of vertices, counter-clockwise seen from outside, (m, 3).
        normals: Unit vectors at the vertices, (n, 3).
        colors: sRGB and opacity of the vertices, (n, 4).
    """

    link: str
    X_LM: NDArray[np.float64]
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]


def load_visuals(
    urdf: str, description: Path, links: Collection[str] | None = None
) -> list[Visual]:
    """Return the visual meshes of all links that have one, in the order of the URDF.

    Args:
        urdf: Text of the URDF, such as `fulcrum.assets.from_urdf.urdf_of("baxter")` returns.
        description: Path of the URDF, relative to which mesh files are found.
        links: Names of the links to read; None for all.

    Raises:
        ModelError: A mesh is missing or outside the URDF's package.
    """
    visuals = []
    robot = ET.fromstring(urdf)
    named = named_colors(robot)
    for link in robot.findall("link"):
        if links is not None and link.attrib["name"] not in links:
            continue
        for visual in link.iter("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            file = named_file(mesh.get("filename", ""), description)
            arrays = _light_mesh(file, scale_of(mesh), rgba_of(visual, named))
            visuals.append(Visual(link.attrib["name"], pose_of(visual), *arrays))
    return visuals


def link_names(urdf: str) -> list[str]:
    """Return the names of all links of a URDF."""
    return [link.attrib["name"] for link in ET.fromstring(urdf).findall("link")]


def pose_of(element: ET.Element) -> NDArray[np.float64]:
    """Return the pose in an `<origin>` [m], (4, 4), from fixed-axis roll, pitch and yaw."""
    pose, origin = np.eye(4), element.find("origin")
    if origin is not None:
        rpy = _numbers(origin.get("rpy", "0 0 0"))
        pose[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
        pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return pose


def named_colors(robot: ET.Element) -> dict[str, tuple[float, ...]]:
    """Return the colours in [0, 1] of the shared materials of a URDF, by name."""
    materials = {material.get("name", ""): material for material in robot.findall("material")}
    colors = ((name, material.find("color")) for name, material in materials.items())
    return {name: tuple(_numbers(c.attrib["rgba"])) for name, c in colors if c is not None}


def rgba_of(
    element: ET.Element, named: Mapping[str, tuple[float, ...]]
) -> tuple[float, ...] | None:
    """Return the colour in [0, 1] of the `<material>` of a link or visual; None without one.

    Args:
        element: The link or visual.
        named: Colours of the shared materials by name.
    """
    for material in element.iter("material"):
        color = material.find("color")
        if color is not None:
            return tuple(_numbers(color.attrib["rgba"]))
        if material.get("name") in named:
            return named[material.attrib["name"]]
    return None


def scale_of(mesh: ET.Element) -> tuple[float, ...]:
    """Return the three scale factors of a URDF `<mesh>`."""
    return tuple(_numbers(mesh.get("scale", "1 1 1")))


@cache
def _light_mesh(
    file: Path, scale: tuple[float, ...], fallback: tuple[float, ...] | None
) -> list[NDArray]:
    """Return vertices, faces, normals and colours of a mesh file, from the cache if possible."""
    determined_by = [
        file.read_bytes(),
        Path(__file__).with_name("meshes.py").read_bytes(),
        repr((file.suffix, scale, fallback, [version(name) for name in _MESH_READERS])).encode(),
    ]

    def make() -> list[NDArray]:
        from fulcrum.assets.meshes import light_mesh

        return light_mesh(file, scale, fallback)

    return cached(hashlib.sha256(b"".join(determined_by)).hexdigest(), make)


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]
