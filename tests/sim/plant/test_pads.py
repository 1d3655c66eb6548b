"""A hand's pad, pressed onto the object in the plant, yields as its stiffness says."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.sim.model import tip_geom
from fulcrum.sim.plant import MujocoPlant
from fulcrum.sim.scenario import ContactMaterial
from tests.helpers.plants import BOX, HANDS, planned, push

SETTLED = 1500  # steps in which arms and box come to rest


def pressed(stiffness, f_n):
    """Depths [m] and normal forces [N] of both pads, at rest, for a feed-forward of f_n [N]."""
    material = ContactMaterial(stiffness, 0.002)
    hands = tuple(replace(hand, material=material) for hand in BOX.hands)
    plant, q = MujocoPlant(replace(BOX, hands=hands)), planned().holding(0.0)
    plant.reset(q)
    block = push(plant, q, np.full(HANDS, f_n), SETTLED)
    data, model = plant.physics.data.ptr, plant.physics.model.ptr
    depths = []
    for hand in BOX.hands:
        pair = {tip_geom(hand), hand.geom}
        (i,) = [
            i
            for i, geoms in enumerate(data.contact.geom.tolist())
            if {model.geom(g).name for g in geoms} == pair
        ]
        depths.append(-data.contact.dist[i])
    normals = np.array([hand.normal_O for hand in BOX.hands])
    return np.array(depths), np.abs(np.einsum("ni,ni->n", normals, block.f_W[-1, :HANDS, :3]))


@pytest.mark.parametrize("stiffness", [2e4, 4e4, 2e5])
def test_force_over_depth_is_the_stated_stiffness(stiffness):
    for f_n in (15.0, 40.0):
        depths, forces = pressed(stiffness, f_n)
        assert forces.min() > 1.0
        np.testing.assert_allclose(forces / depths, stiffness, rtol=0.005)


def test_a_pad_of_another_stiffness_is_caught():
    depths, forces = pressed(4.2e4, 40.0)
    assert np.abs(forces / depths / 4e4 - 1.0).min() > 0.04
