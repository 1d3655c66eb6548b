"""Facts about robots by MuJoCo and by the belief: shared by the tests of the robot."""

from functools import cache

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.scene import compose, hand_body

BOX = scenario("box-tilt")
# Double precision over a chain of ten frames; the largest numbers are ~1e2 N·m. Measured: 6e-14.
ROUNDING = 1e-12
SAMPLES = 20


@cache
def robot(name):
    return RobotModel(scenario(name))


def plant_model(scene):
    return compose(scene).compile()


def dofs_of(model, belief):
    return [int(model.joint(name).dofadr[0]) for name in belief.joints]


def sampled_positions(belief, count=SAMPLES):
    return np.random.default_rng(1).uniform(belief.q_min, belief.q_max, (count, len(belief.joints)))


def sampled_contacts(count):
    """Arbitrary contact points [m] and axes: the belief must not depend on where they are."""
    rng = np.random.default_rng(2)
    return rng.uniform(-1.0, 1.0, (count, 3)), Rotation.random(count, rng=rng).as_matrix()


def mujoco_facts(model, scene, belief):
    """Gravity, mass matrix and contact Jacobians by MuJoCo at sampled positions."""
    dofs = dofs_of(model, belief)
    addresses = [int(model.joint(name).qposadr[0]) for name in belief.joints]
    data = mujoco.MjData(model)
    p_WC, R_WC = sampled_contacts(len(scene.hands))
    gravity, mass, jacobians = [], [], []
    for q in sampled_positions(belief):
        data.qpos[addresses] = q
        mujoco.mj_forward(model, data)
        gravity.append(data.qfrc_bias[dofs])
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        mass.append(full[np.ix_(dofs, dofs)])
        for hand, p, R in zip(scene.hands, p_WC, R_WC, strict=True):
            J = np.zeros((2, 3, model.nv))
            mujoco.mj_jac(model, data, J[0], J[1], p, model.body(hand_body(hand)).id)
            jacobians.append(np.concatenate([R.T @ J[0][:, dofs], R.T @ J[1][:, dofs]]))
    return {
        "gravity": np.array(gravity),
        "mass": np.array(mass),
        "jacobians": np.array(jacobians),
    }


def belief_facts(belief, hands):
    """The same by the belief."""
    p_WC, R_WC = sampled_contacts(hands)
    gravity, mass, jacobians = [], [], []
    for q in sampled_positions(belief):
        state = belief.at(q)
        gravity.append(state.tau_g)
        mass.append(state.mass_matrix())
        jacobians.extend(state.contact_jacobians(p_WC, R_WC))
    return {
        "gravity": np.array(gravity),
        "mass": np.array(mass),
        "jacobians": np.array(jacobians),
    }


def deviation(scene, model, belief):
    """Largest absolute difference of each fact between the belief and a MuJoCo model [SI]."""
    expected = mujoco_facts(model, scene, belief)
    found = belief_facts(belief, len(scene.hands))
    return {key: float(np.abs(found[key] - expected[key]).max()) for key in expected}
