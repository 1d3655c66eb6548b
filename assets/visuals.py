"""The look of a robot for the recorder: one light, coloured triangle mesh per link."""

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

# What turns a mesh file into arrays: with another version of any of them the cache does not count.
_MESH_READERS = ("fast-simplification", "pycollada", "trimesh")


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


def load_visuals(
    urdf: str, description: Path, links: Collection[str] | None = None
) -> list[Visual]:
    """Visual meshes of all links that have one, in the order of the URDF.

    Args:
        urdf: Text of the URDF, such as `fulcrum.assets.from_urdf.urdf_of("baxter")` returns.
        description: Its file, from which the mesh files are found.
        links: Names of the links that are wanted; None for all.

    Raises:
        ModelError: If a mesh is missing or lies outside the URDF's package.
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
    """Names of all links of a URDF."""
    return [link.attrib["name"] for link in ET.fromstring(urdf).findall("link")]


def pose_of(element: ET.Element) -> NDArray[np.float64]:
    """(4, 4) pose [m] in its `<origin>`: fixed-axis roll, pitch, yaw; identity without one."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"))
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", (roll, pitch, yaw)).as_matrix()
    pose[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
    return pose


def named_colors(robot: ET.Element) -> dict[str, tuple[float, ...]]:
    """Colours in [0, 1] of the materials that a URDF has for all its links, by name."""
    materials = {material.get("name", ""): material for material in robot.findall("material")}
    colors = ((name, material.find("color")) for name, material in materials.items())
    return {name: tuple(_numbers(c.attrib["rgba"])) for name, c in colors if c is not None}


def rgba_of(
    element: ET.Element, named: Mapping[str, tuple[float, ...]]
) -> tuple[float, ...] | None:
    """Colour in [0, 1] of the `<material>` below a link or visual; None if there is none.

    Args:
        element: The link or visual.
        named: Colours of the materials that go by their name alone.
    """
    for material in element.iter("material"):
        color = material.find("color")
        if color is not None:
            return tuple(_numbers(color.attrib["rgba"]))
        if material.get("name") in named:
            return named[material.attrib["name"]]
    return None


def scale_of(mesh: ET.Element) -> tuple[float, ...]:
    """The three scale factors of a URDF `<mesh>`."""
    return tuple(_numbers(mesh.get("scale", "1 1 1")))


@cache
def _light_mesh(
    file: Path, scale: tuple[float, ...], fallback: tuple[float, ...] | None
) -> list[NDArray]:
    """Vertices, faces, normals and colours of a mesh file; from the cache, if it has them."""
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
