"""Hands that share a load across their normals: how they divide it, statics does not say."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.model.contacts import ContactFrames
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import N

# Joints move hands by metres per radian; what is this small is rounding.
_STILL = 1e-9


def coupled_hands(scenario: Scenario, robot: RobotModel) -> tuple[tuple[int, ...], ...]:
    """Return groups of hands that no joint moves against each other across their normals.

    The fingers of a gripper are such a group: their joints press, but the wrist alone carries what
    acts across. Which finger takes how much of it depends on friction and compliance, not on what
    is commanded.

    Args:
        scenario: The scene.
        robot: Its robots.
    """
    hands = len(scenario.hands)
    R_WO, p_WO = object_path(scenario.path).pose(0.0)
    frames = ContactFrames(scenario)
    normals = frames.in_world(R_WO)[:hands, :, N]
    state = robot.at(np.array([scenario.posture[joint] for joint in robot.joints]))
    # The hands' motion at one point, in world axes: what is left of a difference is their own.
    J_W = state.contact_jacobians(np.tile(p_WO, (hands, 1)), np.tile(np.eye(3), (hands, 1, 1)))
    groups: list[list[int]] = []
    for i, normal in enumerate(normals):
        across = np.eye(6)
        across[:3, :3] -= np.outer(normal, normal)
        mates = (g for g in groups if np.abs(across @ (J_W[i] - J_W[g[0]])).max() < _STILL)
        group = next(mates, None)
        if group is None:
            groups.append([i])
        else:
            group.append(i)
    return tuple(tuple(group) for group in groups if len(group) > 1)
