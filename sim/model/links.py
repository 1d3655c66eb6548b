"""Pairs of links that are not neighbours in a chain, and their distances."""

from __future__ import annotations

from typing import Any

import mujoco

from fulcrum.assets.mjcf import LOOKS
from fulcrum.sim.scenario import Scenario

DETECTION = 0.05
"""Distance below which collision avoidance acts on links [m]."""

Names = tuple[str, str]


def is_solid(geom: Any) -> bool:
    """Return whether a compiled scene's geom may touch others; otherwise it is only visual."""
    return int(geom.group[0]) != LOOKS


def distance(model: mujoco.MjModel, data: mujoco.MjData, first: int, second: int) -> float:
    """Return the distance of two geoms [m], at most :data:`DETECTION`; negative in overlap."""
    return mujoco.mj_geomDistance(model, data, first, second, DETECTION, None)


def link_pairs(scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData) -> list[Names]:
    """Return the pairs of links that must not touch: those apart in the start posture.

    Args:
        scenario: The scene.
        model: The compiled scene.
        data: State of the scene in the start posture.
    """
    return [pair for pair, distance in between_links(scenario, model, data) if distance > 0.0]


def between_links(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> list[tuple[Names, float]]:
    """Return the pairs of links that are not neighbours in a chain, and their distances [m]."""
    surroundings = [g.name for g in (*scenario.object.geoms, *scenario.environment)]
    names = [g.name for g in map(model.geom, range(model.ngeom)) if is_solid(g)]
    links = [name for name in names if name not in surroundings]
    moving = [name for name in links if model.body_weldid[model.geom(name).bodyid[0]] != 0]
    fixed = [name for name in links if name not in moving]
    ids = {name: model.geom(name).id for name in links}
    chains = {name: _ancestors(model, model.geom_bodyid[g]) for name, g in ids.items()}
    pairs = []
    for i, link in enumerate(moving):
        for other in (*moving[i + 1 :], *fixed):
            # At most three joints lie between two bodies of one chain.
            near = chains[link][0] in chains[other] or chains[other][0] in chains[link]
            if not near:
                pairs.append(((link, other), distance(model, data, ids[link], ids[other])))
    return pairs


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the weld groups of a body and of the next three bodies up its chain of joints."""
    weld, parent = model.body_weldid, model.body_parentid
    chain = [int(weld[body])]
    for _ in range(3):
        chain.append(int(weld[parent[chain[-1]]]))
    return chain
