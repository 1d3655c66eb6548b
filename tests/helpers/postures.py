"""Planned postures of scenarios, and MuJoCo's data in them: shared by the tests of the path."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.scene import ObjectMotion, compose
from fulcrum.sim.motion.ik import plan_joints


@cache
def planned(name):
    return plan_joints(scenario(name))


@cache
def posed_model(name):
    return compose(scenario(name), ObjectMotion.POSED).compile()


def asked(schedule, index, progress):
    """Tilt [rad] and gap [m] that a phase asks for at a progress."""
    before, phase = schedule.before(index), schedule.phases[index]
    tilt = before.tilt + (phase.tilt - before.tilt) * progress
    return schedule.end * tilt, before.gap + (phase.gap - before.gap) * progress


def posed(scene, model, q, tilt):
    """MuJoCo's data with the robot at angles q, (l,), and the object at a tilt [rad]."""
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[model.actuator_trnid[:, 0]]] = q
    R_WO, p_WO = ScrewPath(scene.path).pose(tilt)
    mocap = model.body(scene.object.name).mocapid[0]
    data.mocap_pos[mocap] = p_WO
    data.mocap_quat[mocap] = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    mujoco.mj_kinematics(model, data)
    return data


def on_grid(path):
    """Phase and progress of every point of the grids."""
    return [(i, float(x)) for i, grid in enumerate(path.progress) for x in grid]


def between(path):
    """Phase and progress between the points of the grids, ten in every step."""
    fractions = (np.arange(10) + 0.5) / 10
    return [
        (i, float(x))
        for i, grid in enumerate(path.progress)
        for x in (grid[:-1, None] + np.diff(grid)[:, None] * fractions).ravel()
    ]


def tampered(path, change):
    """The path with every joint a little off [rad or m]."""
    return replace(path, q=tuple(q + change for q in path.q))
