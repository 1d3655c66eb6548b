"""The bodies in a recording's 3D view: their shapes, and their poses over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from fulcrum.assets.mjcf import LOOKS
from fulcrum.assets.models import looks_of
from fulcrum.assets.visuals import Visual, link_names, load_visuals
from fulcrum.sim.model import ObjectMotion, compose, hand_body
from fulcrum.sim.recording.blueprint import TIMELINE
from fulcrum.sim.recording.columns import poses
from fulcrum.sim.scenario import Robot, Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis.arrays import Array

WORLD = "world"
_POSES = f"{WORLD}/poses"  # one entity for the poses of all bodies; its rows name the frames
# Edge length and thickness of the plate that shows an infinite plane [m].
_PLANE_SIZE, _PLANE_THICKNESS = 2.0, 0.002


class Scenery:
    """The static shapes and moving bodies of a scenario, posed by the kinematics of the scene."""

    def __init__(self, scenario: Scenario, joints: tuple[str, ...]) -> None:
        self._scenario = scenario
        self._model = compose(scenario, ObjectMotion.POSED).compile()
        self._data = mujoco.MjData(self._model)
        self._q = np.array([int(self._model.joint(name).qposadr[0]) for name in joints])
        self._object = int(self._model.body(scenario.object.name).mocapid[0])
        self._visuals: list[Visual] = []
        self._dressed: set[str] = set()  # bodies of robots with meshes
        for robot in scenario.robots:
            self._dress(robot)
        shown = {self._model.body(visual.link).id for visual in self._visuals}
        shown |= {int(self._model.geom_bodyid[g]) for g in self._primitives()}
        bodies = np.array(sorted(shown))
        moves = (self._model.body_weldid[bodies] != 0) | (self._model.body_mocapid[bodies] >= 0)
        self._moving, self._fixed = bodies[moves], bodies[~moves]
        self._frames = [f"tf#/{self._path(body)}" for body in self._moving]

    def _dress(self, robot: Robot) -> None:
        """Store the meshes of a robot, if it has any."""
        description = looks_of(robot.model)
        if description is None:
            return
        urdf = description.read_text()
        names = {self._model.body(b).name for b in range(self._model.nbody)}
        links = {link for link in link_names(urdf) if robot.prefix + link in names}
        visuals = load_visuals(urdf, description, links)
        self._visuals += [replace(v, link=robot.prefix + v.link) for v in visuals]
        if visuals:
            self._dressed |= {robot.prefix + link for link in links}

    def _primitives(self) -> Iterator[int]:
        """Yield visible geoms; collision primitives of a robot only if it has no meshes."""
        scenario = self._scenario
        own = {g.name for g in (*scenario.object.geoms, *scenario.environment)}
        hands = {self._model.body(hand_body(hand)).id for hand in scenario.hands}
        for g in range(self._model.ngeom):
            if self._model.geom_rgba[g, 3] == 0.0:
                continue
            body = int(self._model.geom_bodyid[g])
            is_own = self._model.geom(g).name in own or body in hands
            is_bare = self._model.body(body).name not in self._dressed
            if is_own or (is_bare and self._model.geom_group[g] in (0, LOOKS)):
                yield g

    def log_shapes(self, recording: rr.RecordingStream) -> None:
        """Log everything that does not change."""
        recording.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for i, visual in enumerate(self._visuals):
            path = f"{self._path(self._model.body(visual.link).id)}/mesh_{i}"
            recording.log(path, _transform(visual.X_LM), static=True)
            recording.log(
                path,
                rr.Mesh3D(
                    vertex_positions=visual.vertices,
                    triangle_indices=visual.faces,
                    vertex_normals=visual.normals,
                    vertex_colors=visual.colors,
                ),
                static=True,
            )
        for g in self._primitives():
            geom = self._model.geom(g)
            path = f"{self._path(int(geom.bodyid[0]))}/{geom.name}"
            recording.log(path, _shape(self._model, g), static=True)
        mujoco.mj_kinematics(self._model, self._data)
        for body in self._fixed:
            recording.log(
                self._path(body),
                rr.Transform3D(
                    translation=self._data.xpos[body],
                    quaternion=rr.Quaternion(xyzw=np.roll(self._data.xquat[body], -1)),
                ),
                static=True,
            )

    def send_poses(self, recording: rr.RecordingStream, rows: Trace) -> None:
        """Send the poses of all moving bodies at the given rows."""
        positions = np.empty((len(rows), len(self._moving), 3))
        quaternions = np.empty((len(rows), len(self._moving), 4))
        for k in range(len(rows)):
            self._data.qpos[self._q] = rows.q[k]
            self._data.mocap_pos[self._object] = rows.p_WO[k]
            self._data.mocap_quat[self._object] = rows.quat_WO[k]
            mujoco.mj_kinematics(self._model, self._data)
            positions[k] = self._data.xpos[self._moving]
            quaternions[k] = self._data.xquat[self._moving]
        time = rr.TimeColumn(TIMELINE, duration=np.repeat(rows.t, len(self._moving)))
        xyzw = np.roll(quaternions, -1, axis=2).reshape(-1, 4)
        columns = poses(self._frames * len(rows), positions.reshape(-1, 3), xyzw)
        recording.send_columns(_POSES, [time], columns)

    def _path(self, body: int) -> str:
        return f"{WORLD}/{self._model.body(body).name}"


def _transform(X: Array) -> rr.Transform3D:
    return rr.Transform3D(translation=X[:3, 3], mat3x3=X[:3, :3])


def _shape(model: mujoco.MjModel, g: int) -> rr.AsComponents:
    geom = model.geom(g)
    size = geom.size
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_MESH:
        return _mesh(model, g)
    placed = {
        "centers": [geom.pos],
        "quaternions": [rr.Quaternion(xyzw=np.roll(geom.quat, -1))],
        "colors": [(255 * geom.rgba).astype(np.uint8)],
        "fill_mode": "solid",
    }
    match mujoco.mjtGeom(int(geom.type[0])):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=[size], **placed)
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return rr.Ellipsoids3D(half_sizes=[np.full(3, size[0])], **placed)
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=[size], **placed)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return rr.Cylinders3D(radii=[size[0]], lengths=[2 * size[1]], **placed)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            placed["translations"] = [geom.pos - [0, 0, size[1]]]
            del placed["centers"]
            return rr.Capsules3D(radii=[size[0]], lengths=[2 * size[1]], **placed)
        case _:
            half = [x or _PLANE_SIZE / 2 for x in size[:2]]
            return rr.Boxes3D(half_sizes=[[*half, _PLANE_THICKNESS / 2]], **placed)


def _mesh(model: mujoco.MjModel, g: int) -> rr.AsComponents:
    """Return a mesh geom in its body's frame, with flat faces."""
    geom, mesh = model.geom(g), model.mesh(int(model.geom_dataid[g]))
    vertices = slice(int(mesh.vertadr[0]), int(mesh.vertadr[0] + mesh.vertnum[0]))
    faces = slice(int(mesh.faceadr[0]), int(mesh.faceadr[0] + mesh.facenum[0]))
    turned = Rotation.from_quat(geom.quat, scalar_first=True).apply(model.mesh_vert[vertices])
    corners = (geom.pos + turned)[model.mesh_face[faces]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3).astype(np.float32),
        vertex_normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        albedo_factor=(255 * geom.rgba).astype(np.uint8),
    )
