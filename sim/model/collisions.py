"""Pairs of geoms between which collisions are avoided: links, object and environment."""

from __future__ import annotations

import mujoco

from fulcrum.sim.model.links import Names, between_links, link_pairs
from fulcrum.sim.model.scene import unwanted_pairs
from fulcrum.sim.scenario import Scenario


def collision_pairs(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> list[tuple[list[str], list[str]]]:
    """Return the pairs of geom groups to keep apart: links against links, object and environment.

    Not included are tips against what they touch, link pairs with at most three joints between
    them, and link pairs that overlap in the start posture: the collision primitives of joint
    housings overlap by construction.

    Args:
        scenario: The scene.
        model: The compiled scene.
        data: State of the scene in the start posture.
    """
    pairs = [*unwanted_pairs(scenario, model), *link_pairs(scenario, model, data)]
    return [([first], [second]) for first, second in pairs]


def overlapping_links(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> dict[Names, float]:
    """Return the overlaps [m] of link pairs that :func:`collision_pairs` leaves out for overlap."""
    every = between_links(scenario, model, data)
    return {pair: -distance for pair, distance in every if not distance > 0.0}
