"""Contacts of the scene have the stiffness and damping that the scenario states."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.model.scene import compose, pair_materials
from fulcrum.sim.model.stiffness import set_stiffness
from fulcrum.sim.scenario.material import ContactMaterial

BOX = scenario("box-tilt")
LOADS = (10.0, 20.0, 40.0)  # [N] on top of the box's weight of 20 N
EDGES = 4  # contacts of a box that lies flat


def resting(stiffness, load, model=None):
    """Depth of the box's contacts [m], where it lies, and normal force of each [N]."""
    material = ContactMaterial(stiffness, 0.005)
    supports = tuple(replace(support, material=material) for support in BOX.supports)
    scene = compose(replace(BOX, supports=supports)).compile() if model is None else model
    data = mujoco.MjData(scene)
    box = scene.body("box").id
    data.xfrc_applied[box, 2] = -load
    for _ in range(1500):
        mujoco.mj_step(scene, data)
    wrench, depths, forces = np.zeros(6), [], []
    for i in range(data.ncon):
        if "box" in [scene.geom(g).name for g in data.contact.geom[i]]:
            mujoco.mj_contactForce(scene, data, i, wrench)
            depths.append(-data.contact.dist[i])
            forces.append(wrench[0])
    return np.array(depths), np.array(forces)


@pytest.mark.parametrize("stiffness", [2e4, 4e4, 4e5, 1e6])
def test_force_over_depth_is_the_stated_stiffness(stiffness):
    for load in LOADS:
        depths, forces = resting(stiffness, load)
        assert len(forces) == EDGES
        weight = BOX.object.mass * 9.81
        assert forces.sum() == pytest.approx(weight + load, rel=1e-6)  # at rest
        np.testing.assert_allclose(forces / depths, stiffness, rtol=0.005)


def test_stiffness_is_kept_where_the_masses_of_the_scene_change():
    model = compose(BOX).compile()
    box = model.body("box").id
    model.body_mass[box] *= 3.0
    model.body_inertia[box] *= 3.0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    stated = BOX.supports[0].material.stiffness
    depths, forces = resting(stated, 10.0, model)
    # As composed, for the old mass, it is not.
    assert abs((forces / depths).mean() / stated - 1.0) > 0.5
    set_stiffness(model, pair_materials(BOX))
    depths, forces = resting(stated, 10.0, model)
    np.testing.assert_allclose(forces / depths, stated, rtol=0.005)


def test_damping_closes_a_contact_at_the_stated_rate():
    """A heavy box that falls onto soft supports, whose added mass is small, is as a textbook's."""
    stiffness, damping_s = 2e3, 0.01
    material = ContactMaterial(stiffness, damping_s)
    supports = tuple(replace(support, material=material) for support in BOX.supports)
    model = compose(replace(BOX, supports=supports)).compile()
    model.opt.timestep = 1e-4
    set_stiffness(model, dict.fromkeys(pair_materials(BOX), material))
    data = mujoco.MjData(model)
    mass, k, d = BOX.object.mass, EDGES * stiffness, EDGES * stiffness * damping_s
    added = EDGES * 0.25 / (1.0 / mass)  # of the least impedance, 0.2
    free = model.joint("box").qposadr[0] + 2
    start, depth = data.qpos[free], []
    for _ in range(2000):
        mujoco.mj_step(model, data)
        depth.append(start - data.qpos[free])
    rate, t = d / (mass + added) / 2.0, 1e-4 * np.arange(1, 2001)
    omega = np.sqrt(k / (mass + added) - rate**2)
    sunk = mass * 9.81 / k
    expected = sunk * (
        1.0 - np.exp(-rate * t) * (np.cos(omega * t) + rate / omega * np.sin(omega * t))
    )
    # The first step makes the contact.
    np.testing.assert_allclose(depth, expected, rtol=0, atol=0.02 * sunk)
