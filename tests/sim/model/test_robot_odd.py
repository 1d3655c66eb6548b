"""The belief about robots in other places and of other joints agrees with MuJoCo, too."""

from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.robot_model import RobotModel, pinocchio_model
from tests.helpers.beliefs import (
    ROUNDING,
    SAMPLES,
    deviation,
    plant_model,
    robot,
)

BOX = scenario("box-tilt")

each_scenario = pytest.mark.parametrize("name", scenarios())


# --- other places and other robots ---


def test_a_moved_and_turned_base_changes_gravity_as_in_mujoco():
    turn = Rotation.from_rotvec([0.4, -0.3, 0.8]).as_quat(scalar_first=True)
    base = Pose((0.1, -0.2, 0.3), tuple(turn.tolist()))
    moved = replace(BOX, robots=(replace(BOX.robots[0], base=base),))
    belief = RobotModel(moved)
    found = deviation(moved, plant_model(moved), belief)
    assert max(found.values()) < ROUNDING, found
    # Half a radian of lean is caught where the base is believed upright.
    assert deviation(moved, plant_model(moved), robot("box-tilt"))["gravity"] > 1.0
    assert deviation(moved, plant_model(moved), robot("box-tilt"))["jacobians"] > 0.1


ODD_ROBOT = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0.5 -1 -9.81"/>
  <worldbody>
    <body name="pillar" pos="0.1 0.2 0.3" quat="0.9 0.1 0.3 0.2">
      <inertial pos="0 0 0.1" mass="3" diaginertia="0.1 0.1 0.1"/>
      <body name="swing" pos="0 0 0.4" quat="0.7 0.7 0 0.1">
        <inertial pos="0.1 0.2 0" quat="0.8 0 0.6 0" mass="1.5" diaginertia="0.02 0.03 0.04"/>
        <joint name="zeta" type="hinge" axis="1 2 0.5" pos="0.05 -0.1 0.2" armature="0.3"/>
        <joint name="alpha" type="slide" axis="0 1 1" pos="0.3 0.1 0"/>
        <body name="welded" pos="0.2 0 0.1" quat="0.6 0 0 0.8">
          <inertial pos="0 0.1 0" mass="0.7" diaginertia="0.01 0.02 0.02"/>
          <site name="on_welded" pos="0.1 0.1 0.1" quat="0.5 0.5 0.5 0.5"/>
          <body name="tip" pos="0 0.3 0">
            <inertial pos="0 0 0.05" mass="0.4" diaginertia="0.001 0.002 0.002"/>
            <joint name="mid" type="hinge" axis="0 0 1" pos="0.02 0 0"/>
            <site name="on_tip" pos="0 0 0.2"/>
          </body>
        </body>
      </body>
      <body name="rail">
        <inertial pos="0 0 0" mass="0.9" diaginertia="0.01 0.01 0.01"/>
        <joint name="beta" type="slide" axis="1 0 0" armature="0.1"/>
      </body>
    </body>
    <body name="thing" pos="1 0 0">
      <freejoint/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
      <body name="lid" pos="0 0 0.1">
        <inertial pos="0 0 0" mass="0.2" diaginertia="0.01 0.01 0.01"/>
        <joint name="lid" type="hinge" axis="0 1 0"/>
        <site name="on_lid"/>
      </body>
    </body>
    <site name="on_floor" pos="1 2 3"/>
  </worldbody>
</mujoco>
"""
ODD_JOINTS = ("zeta", "alpha", "mid", "beta")


def odd_deviation(model, belief):
    """Largest difference of gravity, mass matrix, site poses and Jacobians of the odd robot."""
    rng = np.random.default_rng(4)
    data, pin_data = mujoco.MjData(model), belief.createData()
    dofs = [int(model.joint(j).dofadr[0]) for j in ODD_JOINTS]
    columns = [belief.joints[belief.getJointId(j)].idx_v for j in ODD_JOINTS]
    worst = dict.fromkeys(("gravity", "mass", "pose", "jacobian"), 0.0)

    def note(fact, found, expected):
        worst[fact] = max(worst[fact], float(np.abs(found - expected).max()))

    for _ in range(SAMPLES):
        angles = rng.uniform(-1.5, 1.5, len(ODD_JOINTS))
        q = np.zeros(belief.nq)
        q[columns] = angles
        for joint, angle in zip(ODD_JOINTS, angles, strict=True):
            data.qpos[model.joint(joint).qposadr[0]] = angle
        mujoco.mj_forward(model, data)
        gravity = pin.computeGeneralizedGravity(belief, pin_data, q)
        note("gravity", gravity[columns], data.qfrc_bias[dofs])
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        mass = np.triu(pin.crba(belief, pin_data, q))
        mass = mass + np.triu(mass, 1).T
        note("mass", mass[np.ix_(columns, columns)], full[np.ix_(dofs, dofs)])
        for site in ("on_welded", "on_tip", "on_floor"):
            frame = belief.getFrameId(site)
            J = pin.computeFrameJacobian(
                belief, pin_data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            pin.framesForwardKinematics(belief, pin_data, q)
            placement = pin_data.oMf[frame]
            note("pose", placement.translation, data.site(site).xpos)
            note("pose", placement.rotation, data.site(site).xmat.reshape(3, 3))
            expected = np.zeros((6, model.nv))
            mujoco.mj_jacSite(model, data, expected[:3], expected[3:], model.site(site).id)
            note("jacobian", J[:, columns], expected[:, dofs])
    return worst


def test_slides_offsets_several_joints_per_body_and_armatures_are_understood():
    model = mujoco.MjModel.from_xml_string(ODD_ROBOT)
    found = odd_deviation(model, pinocchio_model(model))
    assert max(found.values()) < ROUNDING, found


@pytest.mark.parametrize(
    ("right", "wrong", "fact"),
    [
        ('mass="0.4"', 'mass="0.401"', "gravity"),
        ('pos="0.05 -0.1 0.2"', 'pos="0.05 -0.101 0.2"', "pose"),
        ('axis="0 1 1"', 'axis="0 1 1.01"', "jacobian"),
        ('armature="0.3"', 'armature="0.301"', "mass"),
        ('quat="0.6 0 0 0.8"', 'quat="0.601 0 0 0.8"', "pose"),
        ('gravity="0.5 -1', 'gravity="0.501 -1', "gravity"),
    ],
)
def test_a_tampered_odd_robot_is_caught(right, wrong, fact):
    assert ODD_ROBOT.count(right) == 1
    model = mujoco.MjModel.from_xml_string(ODD_ROBOT)
    tampered = mujoco.MjModel.from_xml_string(ODD_ROBOT.replace(right, wrong))
    # A thousandth of numbers of 0.1 to 1.
    assert odd_deviation(model, pinocchio_model(tampered))[fact] > 1e-4


def test_free_bodies_and_what_hangs_on_them_are_left_out():
    belief = pinocchio_model(mujoco.MjModel.from_xml_string(ODD_ROBOT))
    assert set(belief.names) == {"universe", *ODD_JOINTS}
    assert not belief.existFrame("on_lid")
    assert belief.existFrame("on_tip")
