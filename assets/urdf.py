"""Conversion of a robot's URDF to MJCF.

MuJoCo's URDF reader provides kinematics and inertias. The shapes are the URDF's collision
primitives, with boxes instead of meshes. Names, colours, motors and speed limits are added, and
every number is written with all its digits (`MjSpec.to_xml` keeps only six).
"""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from pathlib import Path

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.intersections import slice_faces_plane

from fulcrum.assets.meshes import UNPAINTED, read_mesh
from fulcrum.assets.packages import ModelError, named_file
from fulcrum.assets.visuals import named_colors, pose_of, rgba_of, scale_of

PLACEHOLDER = 0.001
"""Radius [m] of the sphere in a URDF for a link without a real collision shape."""
JOINTS = ("revolute", "continuous", "prismatic", "fixed")
"""Types of joints that the robot model supports."""
DEFAULT = """
<default>
  <default class="{name}">
    <geom contype="0" conaffinity="0" mass="0"/>
  </default>
</default>"""

Cuts = Mapping[str, tuple[float, ...]]


def mjcf_of(urdf: str, description: Path, cuts: Cuts | None = None) -> ET.Element:
    """Return a robot as MJCF.

    Masses, centres of mass, inertias, joint frames, ranges, damping and torque limits are those of
    the URDF; links keep their names and are not fused. Geoms have no mass and touch nothing unless
    a scene has `<pair>` elements for them. A joint's `user` number is its speed limit. Limits that
    are missing or 0 in the URDF are left out.

    Args:
        urdf: Text of the URDF.
        description: Path of the URDF, relative to which mesh files are found.
        cuts: Heights [m], by link, that cut its meshes into slices with a box each.

    Raises:
        ModelError: MuJoCo cannot read it, the robot model does not support a joint, or a mesh is
            missing or outside the URDF's package.
    """
    robot = _checked(urdf)
    shapes = copy.deepcopy(robot)
    _use_primitives(shapes, description, cuts or {})
    options = {"fusestatic": "false", "balanceinertia": "false"}
    ET.SubElement(ET.SubElement(shapes, "mujoco"), "compiler", options)
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(shapes, encoding="unicode"))
        for body in spec.bodies:
            for index, geom in enumerate(body.geoms):
                geom.name = body.name if len(body.geoms) == 1 else f"{body.name}_{index}"
        spec.compile()
    except ValueError as error:
        raise ModelError(str(error), "a URDF that MuJoCo reads") from None
    mjcf = ET.fromstring(spec.to_xml())
    _write_all_digits(mjcf, spec)
    _dress(mjcf, robot)
    return mjcf


def text(mjcf: ET.Element) -> str:
    """Return MJCF as indented text."""
    ET.indent(mjcf)
    return ET.tostring(mjcf, encoding="unicode") + "\n"


def without_branches(urdf: str, joints: tuple[str, ...]) -> str:
    """Return the URDF without the given joints and all their descendants.

    Elements for Gazebo and ROS transmissions are removed, too, since they may name removed links.

    Raises:
        ValueError: A joint is missing; the message lists the valid joints.
    """
    robot = ET.fromstring(urdf)
    links = {joint.attrib["name"]: _ends(joint) for joint in robot.findall("joint")}
    for missing in (joint for joint in joints if joint not in links):
        raise ValueError(f"joint: got {missing!r}; valid is one of {', '.join(links)}.")
    removed = {links[joint][1] for joint in joints}
    while more := {child for parent, child in links.values() if parent in removed} - removed:
        removed |= more
    for element in list(robot):
        gone = element.tag in ("gazebo", "transmission")
        gone |= element.tag == "link" and element.attrib["name"] in removed
        gone |= element.tag == "joint" and _ends(element)[1] in removed
        if gone:
            robot.remove(element)
    return ET.tostring(robot, encoding="unicode")


def _checked(urdf: str) -> ET.Element:
    """Return the robot with only its links, joints and materials."""
    robot = ET.fromstring(urdf)
    for element in list(robot):
        if str(element.tag).startswith(("xacro:", "{http://www.ros.org/wiki/xacro}")):
            raise ModelError("a file with xacro macros", "a URDF made from it with `xacro`")
        if element.tag not in ("link", "joint", "material"):
            robot.remove(element)
    for joint in robot.findall("joint"):
        kind = joint.get("type")
        if kind not in JOINTS:
            given = f"joint {joint.get('name')} of type {kind}"
            raise ModelError(given, f"one of type {', '.join(JOINTS)}")
        # A joint that follows another in the robot's controller is an independent joint here.
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    return robot


def _use_primitives(robot: ET.Element, description: Path, cuts: Cuts) -> None:
    """Keep only primitive collision shapes of each link: its own, else its visual's, else boxes."""
    for link in robot.findall("link"):
        visuals, collisions = link.findall("visual"), link.findall("collision")
        shapes = [shape for shape in collisions if not _is_placeholder(shape)] or visuals
        for shape in visuals + collisions:
            link.remove(shape)
        for shape in shapes:
            if shape.find("geometry/mesh") is None:
                ET.SubElement(link, "collision").extend(shape.findall("*"))
            else:
                link.extend(_boxes(shape, description, cuts.get(link.attrib["name"], ())))


def _is_placeholder(shape: ET.Element) -> bool:
    sphere = shape.find("geometry/sphere")
    return sphere is not None and float(sphere.attrib["radius"]) <= PLACEHOLDER


def _boxes(shape: ET.Element, description: Path, cuts: tuple[float, ...]) -> list[ET.Element]:
    """Return boxes along the link's axes around the slices of a mesh, rounded to 0.1 mm."""
    mesh = shape.find("geometry/mesh")
    assert mesh is not None
    file = named_file(mesh.get("filename", ""), description)
    boxes = []
    for low, high in zip((-np.inf, *cuts), (*cuts, np.inf), strict=True):
        points = [
            _slice(part.apply_transform(pose_of(shape)), low, high)
            for part in read_mesh(file, scale_of(mesh))
        ]
        lower, upper = np.vstack(points).min(axis=0), np.vstack(points).max(axis=0)
        box = ET.Element("collision")
        ET.SubElement(box, "origin", xyz=_digits(np.round((lower + upper) / 2, 4)))
        geometry = ET.SubElement(box, "geometry")
        ET.SubElement(geometry, "box", size=_digits(np.round(upper - lower, 4)))
        boxes.append(box)
    return boxes


def _slice(part: trimesh.Trimesh, low: float, high: float) -> NDArray[np.float64]:
    """Return the vertices of a mesh between two heights [m], (n, 3)."""
    vertices, faces = part.vertices, part.faces
    for height, up in ((low, 1.0), (high, -1.0)):
        if np.isfinite(height):
            vertices, faces, *_ = slice_faces_plane(vertices, faces, (0, 0, up), (0, 0, height))
    return vertices[np.unique(faces)]


def _link_colors(robot: ET.Element) -> dict[str, tuple[float, ...]]:
    """Return the URDF's colour of each link, or else that of its parent."""
    named = named_colors(robot)
    colors = {link.attrib["name"]: rgba_of(link, named) for link in robot.findall("link")}
    parents = {child: parent for parent, child in map(_ends, robot.findall("joint"))}

    def inherited(link: str) -> tuple[float, ...]:
        return colors[link] or (inherited(parents[link]) if link in parents else UNPAINTED)

    return {link: inherited(link) for link in colors}


def _dress(mjcf: ET.Element, robot: ET.Element) -> None:
    """Add default class, colours, speed limits and motors, which the URDF reader leaves out."""
    worldbody = mjcf.find("worldbody")
    assert worldbody is not None
    name = re.sub(r"\W", "_", robot.get("name", "robot"))
    mjcf.insert(list(mjcf).index(worldbody), ET.fromstring(DEFAULT.format(name=name)))
    for root in worldbody.findall("body"):
        root.set("childclass", name)
    colors = _link_colors(robot)
    for body in worldbody.iter("body"):
        for geom in body.findall("geom"):
            geom.set("rgba", _digits(colors[body.attrib["name"]]))
    motors = ET.SubElement(mjcf, "actuator")
    for joint in worldbody.iter("joint"):
        name = joint.attrib["name"]
        limit = robot.find(f"joint[@name='{name}']/limit")
        stated = {} if limit is None else limit.attrib
        effort, speed = (float(stated.get(key, 0.0)) for key in ("effort", "velocity"))
        motor = ET.SubElement(motors, "motor", name=name, joint=name)
        if 0.0 < speed < np.inf:
            joint.set("user", _digits([speed]))
        if 0.0 < effort < np.inf:
            motor.set("ctrlrange", _digits([-effort, effort]))


def _write_all_digits(mjcf: ET.Element, spec: mujoco.MjSpec) -> None:
    """Replace rounded numbers by those of the spec, and inertias by those of the URDF."""
    for tag, find in (("body", spec.body), ("joint", spec.joint), ("geom", spec.geom)):
        for element in mjcf.findall(f"./worldbody//{tag}"):
            source = find(element.attrib["name"])
            for key in {"pos", "quat", "size", "range"} & element.attrib.keys():
                count = len(element.attrib[key].split())
                element.set(key, _digits(np.atleast_1d(getattr(source, key))[:count]))
    for body in mjcf.findall("./worldbody//body"):
        inertial, source = body.find("inertial"), spec.body(body.attrib["name"])
        if inertial is not None:
            inertial.attrib.clear()
            inertial.set("pos", _digits(source.ipos))
            inertial.set("mass", _digits([source.mass]))
            full = np.isfinite(source.fullinertia).all()  # it is NaN for a zero diagonal
            key, moments = ("full", source.fullinertia) if full else ("diag", source.inertia)
            inertial.set(f"{key}inertia", _digits(moments))


def _digits(values: Iterable[float]) -> str:
    """Return the shortest text that reads back as the same numbers."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def _ends(joint: ET.Element) -> tuple[str, str]:
    """Return the names of the parent and the child link of a joint."""
    parent, child = joint.find("parent"), joint.find("child")
    if parent is None or child is None:
        raise ModelError(f"joint {joint.get('name')}", "one with a parent and a child")
    return parent.attrib["link"], child.attrib["link"]
