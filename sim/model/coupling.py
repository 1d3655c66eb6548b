"""Groups of hands that share a tangential load; statics does not determine their shares."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.model.contacts import ContactFrames
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import N

# Relative motion per joint angle below this is rounding [m/rad].
_STILL = 1e-9


def coupled_hands(scenario: Scenario, robot: RobotModel) -> tuple[tuple[int, ...], ...]:
    """Return groups of hands that no joint moves tangentially against each other.

    The fingers of a gripper are such a group: their joints press, and only the wrist carries the
    tangential load. How the fingers share it depends on friction and compliance, not on the
    command.

    Args:
        scenario: The scene.
        robot: Model of its robots.
    """
    hands = len(scenario.hands)
    R_WO, p_WO = object_path(scenario.path).pose(0.0)
    frames = ContactFrames(scenario)
    normals = frames.in_world(R_WO)[:hands, :, N]
    state = robot.at(np.array([scenario.posture[joint] for joint in robot.joints]))
    # The hands' motion at one common point, in world axes: differences are relative motion.
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
