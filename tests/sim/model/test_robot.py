"""The controller's robot is the plant's robot: Pinocchio's belief against MuJoCo's own numbers."""

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.model.scene import compose, hand_body
from tests.helpers.beliefs import (
    ROUNDING,
    deviation,
    dofs_of,
    plant_model,
    robot,
    sampled_contacts,
    sampled_positions,
)

BOX = scenario("box-tilt")

each_scenario = pytest.mark.parametrize("name", scenarios())


# --- the composed robot ---


@each_scenario
def test_belief_agrees_with_mujoco(name):
    scene = scenario(name)
    found = deviation(scene, plant_model(scene), robot(name))
    assert max(found.values()) < ROUNDING, found


def heavier_wrist(spec):
    spec.body("left_wrist").mass *= 1.01


def longer_hand(spec):
    spec.site("left_tip_center").pos[2] += 1e-3
    spec.body("left_hand_link").pos[2] += 1e-3


def geared_elbow(spec):
    spec.joint("left_e1").armature = 1e-2


@pytest.mark.parametrize(
    ("tamper", "fact", "at_least"),
    [
        (heavier_wrist, "gravity", 1e-2),  # 34 mN more weight at up to 1 m
        (heavier_wrist, "mass", 1e-4),
        (longer_hand, "gravity", 1e-3),  # 2 N of hand, 1 mm further out
        (geared_elbow, "mass", 9e-3),
    ],
)
def test_a_tampered_plant_is_caught(tamper, fact, at_least):
    spec = compose(BOX)
    tamper(spec)
    assert deviation(BOX, spec.compile(), robot("box-tilt"))[fact] > at_least


@each_scenario
def test_joints_and_limits_are_in_the_order_of_the_motors(name):
    belief, model = robot(name), plant_model(scenario(name))
    motors = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
    assert list(belief.joints) == motors
    assert set(motors) == set(scenario(name).posture)
    np.testing.assert_array_equal(
        np.column_stack([belief.tau_min, belief.tau_max]), model.actuator_ctrlrange
    )
    for i, joint in enumerate(motors):
        assert (belief.q_min[i], belief.q_max[i]) == tuple(model.joint(joint).range)
        assert belief.qd_max[i] == model.joint(joint).user[0] > 0.0
        assert belief.damping[i] == model.joint(joint).damping[0]


def test_baxter_s_limits_are_the_official_ones():
    belief = robot("box-tilt")
    limits = dict(zip(belief.joints, belief.tau_max.tolist(), strict=True))
    for side in ("left", "right"):
        arm = [limits[f"{side}_{j}"] for j in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")]
        assert arm == [50.0, 50.0, 50.0, 50.0, 15.0, 15.0, 15.0]
    np.testing.assert_array_equal(belief.tau_min, -belief.tau_max)


def test_joints_of_a_problem_are_the_belief_s():
    belief = robot("box-tilt")
    state = belief.at(sampled_positions(belief, 1)[0])
    p_WC, R_WC = sampled_contacts(2)
    joints = state.statics(p_WC, R_WC)
    assert joints.names == belief.joints
    np.testing.assert_array_equal(joints.J_C, state.contact_jacobians(p_WC, R_WC))
    np.testing.assert_array_equal(joints.tau_g, state.tau_g)
    np.testing.assert_array_equal(joints.tau_min, belief.tau_min)
    np.testing.assert_array_equal(joints.tau_max, belief.tau_max)


# --- what the Jacobian means ---


def moved_points(model, belief, scene, q, p_WC, q_C):
    """Where the hands' points that are at p_WC at angles q_C come to be at angles q, (n, 3)."""
    data = mujoco.MjData(model)
    addresses = [int(model.joint(name).qposadr[0]) for name in belief.joints]
    bodies = [model.body(hand_body(hand)).id for hand in scene.hands]
    data.qpos[addresses] = q_C
    mujoco.mj_kinematics(model, data)
    offsets = np.einsum("nji,nj->ni", data.xmat[bodies].reshape(-1, 3, 3), p_WC - data.xpos[bodies])
    data.qpos[addresses] = q
    mujoco.mj_kinematics(model, data)
    return data.xpos[bodies] + np.einsum("nij,nj->ni", data.xmat[bodies].reshape(-1, 3, 3), offsets)


@each_scenario
def test_jacobian_is_the_derivative_of_the_forward_kinematics(name):
    scene, belief = scenario(name), robot(name)
    model, h = plant_model(scene), 1e-5
    q = sampled_positions(belief, 1)[0]
    p_WC, R_WC = sampled_contacts(len(scene.hands))
    state = belief.at(q)
    J_C = state.contact_jacobians(p_WC, R_WC)
    for j in range(len(belief.joints)):
        step = h * np.eye(len(belief.joints))[j]
        ahead = moved_points(model, belief, scene, q + step, p_WC, q)
        behind = moved_points(model, belief, scene, q - step, p_WC, q)
        expected = np.einsum("nji,nj->ni", R_WC, (ahead - behind) / (2.0 * h))
        # Lever times h^2 / 6 is 4e-11; rounding of 1 m over 2 h is 1e-11.
        np.testing.assert_allclose(J_C[:, :3, j], expected, rtol=0, atol=2e-10)
    # A point a millimetre off is caught.
    shifted = state.contact_jacobians(p_WC + np.array([0.0, 0.0, 1e-3]), R_WC)
    assert np.abs(shifted - J_C).max() > 5e-4


@each_scenario
def test_torque_of_a_contact_wrench_is_mujoco_s_and_does_the_same_work(name):
    scene, belief = scenario(name), robot(name)
    model = plant_model(scene)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(3)
    q, qd = sampled_positions(belief, 1)[0], rng.normal(size=len(belief.joints))
    p_WC, R_WC = sampled_contacts(len(scene.hands))
    wrenches = rng.normal(scale=30.0, size=(len(scene.hands), 6))
    state = belief.at(q)
    joints = state.statics(p_WC, R_WC)
    tau = np.einsum("nkl,nk->l", joints.J_C, wrenches)
    for i, joint in enumerate(belief.joints):
        data.qpos[model.joint(joint).qposadr[0]] = q[i]
        data.qvel[model.joint(joint).dofadr[0]] = qd[i]
    mujoco.mj_forward(model, data)
    applied, power = np.zeros(model.nv), 0.0
    for hand, p, R, w in zip(scene.hands, p_WC, R_WC, wrenches, strict=True):
        body = model.body(hand_body(hand)).id
        force, moment = R @ w[:3], R @ w[3:]
        mujoco.mj_applyFT(model, data, force, moment, p, body, applied)
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
        lever = p - data.xpos[body]
        power += force @ (twist[3:] + np.cross(twist[:3], lever)) + moment @ twist[:3]
    # Forces of 30 N at levers of 1 m: two digits above the rounding of 1.
    np.testing.assert_allclose(tau, applied[dofs_of(model, belief)], rtol=0, atol=ROUNDING)
    assert tau @ qd == pytest.approx(power, abs=10.0 * ROUNDING)
    # The paper's sign of (13), applied to a plant, does the opposite work.
    assert abs(-tau @ qd - power) > 1.0
