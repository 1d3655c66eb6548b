"""Draws every scene with MuJoCo: ``MUJOCO_GL=egl python docs/hooks/pictures.py FOLDER``."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from fulcrum.assets.models import looks_of
from fulcrum.assets.visuals import Visual, link_names, load_visuals
from fulcrum.scenarios import scenarios
from fulcrum.sim.model.object_path import ObjectPath, object_path
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.scene import ObjectMotion, compose
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.joint_path import JointPath
from fulcrum.sim.scenario.scenario import Scenario

_WIDTH, _HEIGHT = 480, 420
_SHARES = (0.0, 0.5, 1.0)  # of the tilt


def draw(scenario: Scenario) -> Image.Image:
    """A scene at the start, half-way and at the end of its tilt, side by side."""
    model = _dressed(scenario).compile()
    data = mujoco.MjData(model)
    path, joints = object_path(scenario.path), RobotModel(scenario).joints
    arms = plan_joints(scenario)
    views = []
    with mujoco.Renderer(model, _HEIGHT, _WIDTH) as renderer:
        for share in _SHARES:
            _pose(scenario, model, data, path, share, joints, arms)
            renderer.update_scene(data, _camera(scenario, model))
            views.append(renderer.render())
    return Image.fromarray(np.concatenate(views, axis=1))


def _pose(
    scenario: Scenario,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    path: ObjectPath,
    share: float,
    joints: tuple[str, ...],
    arms: JointPath,
) -> None:
    """Poses object and robots at a share of the tilt."""
    R_WO, p_WO = path.pose(share * path.end)
    mocap = int(model.body(scenario.object.name).mocapid[0])
    data.mocap_pos[mocap] = p_WO
    mujoco.mju_mat2Quat(data.mocap_quat[mocap], R_WO.ravel())
    for name, angle in zip(joints, arms.holding(share * path.end), strict=True):
        data.qpos[int(model.joint(name).qposadr[0])] = angle
    mujoco.mj_forward(model, data)


def _camera(scenario: Scenario, model: mujoco.MjModel) -> mujoco.MjvCamera:
    """The place that recordings look from."""
    eye, target = np.array(scenario.view.eye), np.array(scenario.view.target)
    look = target - eye
    camera = mujoco.MjvCamera()
    camera.lookat[:] = model.stat.center + target
    camera.distance = float(np.linalg.norm(look))
    camera.azimuth = float(np.degrees(np.arctan2(look[1], look[0])))
    camera.elevation = float(np.degrees(np.arcsin(look[2] / camera.distance)))
    return camera


def _dressed(scenario: Scenario) -> mujoco.MjSpec:
    """The scene with the meshes of its robots instead of their collision primitives."""
    spec = compose(scenario, ObjectMotion.POSED)
    _light(spec)
    for robot in scenario.robots:
        description = looks_of(robot.model)
        if description is None:
            continue
        urdf = description.read_text()
        bodies = {body.name for body in spec.bodies}
        links = {link for link in link_names(urdf) if robot.prefix + link in bodies}
        for link in links:
            for geom in spec.body(robot.prefix + link).geoms:
                geom.rgba = [0.0, 0.0, 0.0, 0.0]
        for number, visual in enumerate(load_visuals(urdf, description, links)):
            owned = replace(visual, link=robot.prefix + visual.link)
            _add_visual(spec, owned, f"{robot.prefix}visual_{number}")
    return spec


def _light(spec: mujoco.MjSpec) -> None:
    """A bright sky, and less light than MuJoCo's viewer has."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.97],
        rgb2=[0.72, 0.78, 0.84],
        width=256,
        height=1536,
    )
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    for light in spec.lights:
        light.diffuse = [0.35, 0.35, 0.35]
    spec.visual.quality.shadowsize = 4096
    spec.visual.quality.offsamples = 8


def _add_visual(spec: mujoco.MjSpec, visual: Visual, name: str) -> None:
    spec.add_mesh(
        name=name,
        uservert=visual.vertices.ravel().tolist(),
        userface=visual.faces.ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, visual.X_LM[:3, :3].ravel().astype(float))
    spec.body(visual.link).add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        pos=visual.X_LM[:3, 3],
        quat=quaternion,
        rgba=visual.colors.mean(axis=0) / 255.0,
        mass=0.0,
        contype=0,
        conaffinity=0,
    )


if __name__ == "__main__":
    for name, scene in scenarios().items():
        draw(scene).save(Path(sys.argv[1]) / f"{name}.png", optimize=True)
