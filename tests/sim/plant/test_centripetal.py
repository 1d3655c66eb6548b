"""The acceleration that MuJoCo's contact rows leave out is added."""

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.plant.centripetal import Centripetal
from fulcrum.sim.plant.mujoco import MujocoPlant

NAMES = ("box-tilt", "cylinder-tilt", "panda-box")
STEP = 1e-6  # of the differences below [s]


def moving(name):
    """A plant in contact whose joints and object move."""
    scene = scenario(name)
    plant = MujocoPlant(scene)
    plant.reset(plan_joints(scene).holding(0.0))
    model, data = plant.physics.model.ptr, plant.physics.data.ptr
    random = np.random.default_rng(3)
    data.qvel[:] = random.uniform(-1.0, 1.0, model.nv)
    # Tips a little into the object, so that hands touch as well.
    place = data.joint(scene.object.name).qpos
    place[:3] -= 1e-5
    for geom in range(model.ngeom):
        if model.geom(geom).name.endswith("_tip"):
            model.geom_size[geom, 0] += 2e-3
    mujoco.mj_step1(model, data)
    return scene, model, data


def bodies_of(model, data, row):
    """Contact of a constraint row, its axis and both bodies."""
    for i in range(data.ncon):
        first, dim = data.contact.efc_address[i], data.contact.dim[i]
        if first <= row < first + dim:
            geoms = data.contact.geom[i]
            return i, row - first, [int(b) for b in model.geom_bodyid[geoms]]
    return None


def row_velocities(model, data, axes, points, bodies, parts):
    """Speeds of rows between material points, here given in each body's own axes."""
    speeds = []
    jac_linear, jac_angular = np.zeros((2, 3, model.nv))
    for frame, place, pair, part in zip(axes, points, bodies, parts, strict=True):
        speed = np.zeros(3)
        for sign, body, own in zip((-1.0, 1.0), pair, place, strict=True):
            point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ own
            mujoco.mj_jac(model, data, jac_linear, jac_angular, point, body)
            jac = jac_angular if part == 3 else jac_linear
            speed += sign * jac @ data.qvel
        speeds.append(frame[0 if part == 3 else part] @ speed)
    return np.array(speeds)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_added_is_the_rate_of_the_rows_speed_at_no_acceleration(name):
    scene, model, data = moving(name)
    before = data.efc_aref.copy()
    Centripetal(scene, model).add(data)
    added = before - data.efc_aref
    found = [(row, bodies_of(model, data, row)) for row in range(data.nefc)]
    rows = [row for row, contact in found if contact]
    contacts = [contact for _, contact in found if contact]
    axes = [data.contact.frame[i].reshape(3, 3).copy() for i, _, _ in contacts]
    bodies = [pair for _, _, pair in contacts]
    points = [
        [data.xmat[b].reshape(3, 3).T @ (data.contact.pos[i] - data.xpos[b]) for b in pair]
        for i, _, pair in contacts
    ]
    parts = [part for _, part, _ in contacts]
    hands = {int(model.body(f"{hand.name}_pad").id) for hand in scene.hands}
    assert any(hands & set(pair) for pair in bodies)
    assert any(0 in pair for pair in bodies)
    speeds = []
    start = data.qpos.copy()
    for sign in (-1.0, 1.0):
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, data.qvel, sign * STEP)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        speeds.append(row_velocities(model, data, axes, points, bodies, parts))
    rate = (speeds[1] - speeds[0]) / (2.0 * STEP)
    # Central differences of a microsecond: 1e-8 m/s^2 and rounding of speeds over 2e-6 s.
    np.testing.assert_allclose(added[rows], rate, rtol=1e-6, atol=1e-7)
    assert np.abs(rate).max() > 0.01
    others = np.setdiff1d(np.arange(data.nefc), rows)
    np.testing.assert_array_equal(added[others], 0.0)


def test_nothing_is_added_to_what_stands_still():
    scene, model, data = moving("box-tilt")
    data.qvel[:] = 0.0
    mujoco.mj_step1(model, data)
    before = data.efc_aref.copy()
    Centripetal(scene, model).add(data)
    np.testing.assert_array_equal(data.efc_aref, before)
