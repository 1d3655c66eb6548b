"""All that can touch collides: what rests on purpose is named, all else must not touch."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.links import link_pairs
from fulcrum.sim.model.scene import compose, object_pairs
from fulcrum.sim.plant.mujoco import MujocoPlant

BOX, PANDAS = scenario("box-tilt"), scenario("panda-box")
POST = Geom("post", "cylinder", (0.01, 0.1), Pose((0.42, 0.0, 0.0)))


def unnamed(model):
    """Pairs of geoms that must not touch, as the compiled scene has them."""
    pairs = [i for i in range(model.npair) if not model.pair(i).name]
    return {
        frozenset(model.geom(int(g)).name for g in (model.pair_geom1[i], model.pair_geom2[i]))
        for i in pairs
    }


def test_the_object_must_not_touch_what_it_does_not_rest_on():
    model = compose(replace(BOX, environment=(*BOX.environment, POST))).compile()
    assert frozenset(("box", "post")) in unnamed(model)
    assert frozenset(("box", "table")) not in unnamed(model)
    # What is not solid is passed through, by fingers and object alike.
    passed = replace(POST, solid=False)
    assert not object_pairs(replace(BOX, environment=(*BOX.environment, passed)))


def test_arms_must_not_touch_each_other():
    pairs = unnamed(compose(PANDAS).compile())
    sides = [{name.split("_")[0] for name in pair} for pair in pairs]
    assert {"left", "right"} in sides


@pytest.mark.parametrize("name", scenarios())
def test_nothing_collides_at_the_start(name):
    scene = scenario(name)
    plant = MujocoPlant(scene)
    model, data = plant.physics.model.ptr, plant.physics.data.ptr
    for joint, angle in scene.posture.items():
        data.joint(joint).qpos[:] = angle
    mujoco.mj_step1(model, data)
    touching = [[model.geom(g).name for g in pair] for pair in data.contact.geom.tolist()]
    assert not [pair for pair in touching if frozenset(pair) in unnamed(model)]


def test_links_that_overlap_at_the_start_are_left_out():
    model = compose(BOX).compile()
    data = mujoco.MjData(model)
    for joint, angle in BOX.posture.items():
        data.joint(joint).qpos[:] = angle
    mujoco.mj_kinematics(model, data)
    apart = {frozenset(pair) for pair in link_pairs(BOX, model, data)}
    assert apart
    for first, second in map(tuple, apart):
        ids = model.geom(first).id, model.geom(second).id
        assert mujoco.mj_geomDistance(model, data, *ids, 0.05, None) > 0.0


def test_a_box_that_ends_in_a_post_collides():
    scene = replace(
        BOX, environment=(*BOX.environment, replace(POST, pose=Pose((0.65, 0.0, 0.15))))
    )
    plant = MujocoPlant(scene)
    plant.reset(np.array([BOX.posture[joint] for joint in plant.joints]))
    data = plant.physics.data
    data.joint("box").qpos[2] += 0.01
    plant.step()
    model = plant.physics.model.ptr
    touching = {
        frozenset(model.geom(g).name for g in pair) for pair in data.ptr.contact.geom.tolist()
    }
    assert touching & unnamed(model) == {frozenset(("box", "post"))}
