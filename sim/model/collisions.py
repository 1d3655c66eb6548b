"""What links keep clear of: one another, and the scene."""

from __future__ import annotations

import mujoco

from fulcrum.sim.model.links import Names, between_links, link_pairs
from fulcrum.sim.model.scene import unwanted_pairs
from fulcrum.sim.scenario import Scenario


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
    pairs = [*unwanted_pairs(scenario, model), *link_pairs(scenario, model, data)]
    return [([first], [second]) for first, second in pairs]


def overlapping_links(
    scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData
) -> dict[Names, float]:
    """The link pairs that :func:`collision_pairs` leaves out as they overlap, and how far [m]."""
    every = between_links(scenario, model, data)
    return {pair: -distance for pair, distance in every if not distance > 0.0}
