"""What links keep clear of: one another, and the scene."""

from __future__ import annotations

import mujoco

from sim.scenario import Scenario
from sim.scene import unwanted_pairs

DETECTION = 0.05
"""From where links look out for each other and for the scene [m]."""

Names = tuple[str, str]


def collision_pairs(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> list[tuple[list[str], list[str]]]:
    """Links against links, object and environment; not the tips against what they touch.

    Left out, as the collision primitives of joint housings overlap by construction: link pairs with
    at most three joints between them, and those that overlap in the start posture.

    Args:
        scenario: The scene.
        model: It, compiled.
        data: Its state in the start posture.
    """
    apart = [pair for pair, distance in _between_links(scenario, model, data) if distance > 0.0]
    pairs = [*unwanted_pairs(scenario, model), *apart]
    return [([first], [second]) for first, second in pairs]


def overlapping_links(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> dict[Names, float]:
    """The link pairs that :func:`collision_pairs` leaves out as they overlap, and how far [m]."""
    every = _between_links(scenario, model, data)
    return {pair: -distance for pair, distance in every if not distance > 0.0}


def distance(model: mujoco.MjModel, data: mujoco.MjData, first: int, second: int) -> float:
    """Of two geoms [m], negative if they overlap; beyond :data:`DETECTION` that."""
    return mujoco.mj_geomDistance(model, data, first, second, DETECTION, None)


def _between_links(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> list[tuple[Names, float]]:
    """Links that are not near one another in a chain, and their distances [m]."""
    surroundings = [g.name for g in (*scenario.object.geoms, *scenario.environment)]
    names = [model.geom(g).name for g in range(model.ngeom)]
    links = [name for name in names if name not in surroundings]
    moving = [name for name in links if model.body_weldid[model.geom(name).bodyid[0]] != 0]
    pairs = []
    for i, link in enumerate(moving):
        for other in (*moving[i + 1 :], *(name for name in links if name not in moving)):
            first, second = model.geom(link), model.geom(other)
            if not _near_in_chain(model, first.bodyid[0], second.bodyid[0]):
                pairs.append(((link, other), distance(model, data, first.id, second.id)))
    return pairs


def _near_in_chain(model: mujoco.MjModel, first: int, second: int) -> bool:
    """Whether at most three joints lie between two bodies of one chain."""
    a, b = _ancestors(model, first), _ancestors(model, second)
    return a[0] in b or b[0] in a


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """The body and the next three that a joint carries it on, each by its weld group."""
    weld, parent = model.body_weldid, model.body_parentid
    chain = [int(weld[body])]
    for _ in range(3):
        chain.append(int(weld[parent[chain[-1]]]))
    return chain
