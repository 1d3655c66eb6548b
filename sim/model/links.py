"""Links that are not near one another in a chain, and how far apart they are."""

from __future__ import annotations

from typing import Any

import mujoco

from fulcrum.assets.mjcf import LOOKS
from fulcrum.sim.scenario import Scenario

DETECTION = 0.05
"""From where links look out for each other and for the scene [m]."""

Names = tuple[str, str]


def is_solid(geom: Any) -> bool:
    """Whether a compiled scene's geom may touch others, rather than only show what a link is."""
    return int(geom.group[0]) != LOOKS


def distance(model: mujoco.MjModel, data: mujoco.MjData, first: int, second: int) -> float:
    """Of two geoms [m], negative if they overlap; beyond :data:`DETECTION` that."""
    return mujoco.mj_geomDistance(model, data, first, second, DETECTION, None)


def link_pairs(scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData) -> list[Names]:
    """Links that must not touch one another: those that are apart in the start posture.

    Args:
        scenario: The scene.
        model: It, compiled.
        data: Its state in the start posture.
    """
    return [pair for pair, distance in between_links(scenario, model, data) if distance > 0.0]


def between_links(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> list[tuple[Names, float]]:
    """Links that are not near one another in a chain, and their distances [m]."""
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
    """The body and the next three that a joint carries it on, each by its weld group."""
    weld, parent = model.body_weldid, model.body_parentid
    chain = [int(weld[body])]
    for _ in range(3):
        chain.append(int(weld[parent[chain[-1]]]))
    return chain
