"""Application of a world's deviations to a compiled scene's robots."""

from __future__ import annotations

import mujoco
import numpy as np

from fulcrum.sim.model import hand_body, tip_site
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.world import World


def make_true(model: mujoco.MjModel, scenario: Scenario, world: World) -> None:
    """Apply the true hand places, link masses and dry friction to a scene's robots.

    Raises:
        InvalidInputError: A tuple has another length than the number of driven joints, or a fault
            names a joint that does not exist.
    """
    joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
    names = [model.joint(joint).name for joint in joints]
    world.check_joints(names)
    for hand, place in zip(scenario.hands, world.hand_place, strict=False):
        pad, site = model.body(hand_body(hand)).id, model.site(tip_site(hand)).id
        offset = np.array([*place, 0.0])
        for quaternion in (model.site_quat[site], model.body_quat[pad]):
            mujoco.mju_rotVecQuat(offset, offset.copy(), quaternion)
        model.body_pos[pad] += offset
    for joint, factor in zip(joints, world.link_mass, strict=False):
        body = model.jnt_bodyid[joint]
        model.body_mass[body] *= factor
        model.body_inertia[body] *= factor
    if world.joint_friction:
        model.dof_frictionloss[model.jnt_dofadr[joints]] = world.joint_friction
    mujoco.mj_setConst(model, mujoco.MjData(model))
