"""A plant with the box at rest at a tilt, and arms that push: shared by the tests of the plant."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.object import GRAVITY
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.contacts import ContactFrames
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.scenario.material import ContactMaterial
from fulcrum.sim.signals.trace import Trace

# Pads as stiff as hard plastic: the impedance below holds back hands that sink in.
STIFF = ContactMaterial(1.5e6, 0.002)
SOFT_BOX = scenario("box-tilt")
BOX = replace(SOFT_BOX, hands=tuple(replace(hand, material=STIFF) for hand in SOFT_BOX.hands))
WEIGHT = BOX.object.mass * GRAVITY
ROBOT = RobotModel(BOX)
FRAMES = ContactFrames(BOX)
HANDS, CONTACTS = len(BOX.hands), len(BOX.contact_names)
# Joint impedance that keeps the arms where they are while they push [rad/s].
BANDWIDTH = 30.0


@cache
def planned():
    return plan_joints(BOX)


def start_at(tilt_deg):
    """The object's pose at a tilt [deg] of its path."""
    R_WO, p_WO = ScrewPath(BOX.path).pose(np.radians(tilt_deg))
    quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    return Pose(tuple(p_WO.tolist()), tuple(quaternion.tolist()))


def plant_at(tilt_deg):
    """A plant that starts at rest at a tilt, and the arms' angles that hold the box there."""
    plant = MujocoPlant(replace(BOX, path=replace(BOX.path, start=start_at(tilt_deg))))
    q = planned().holding(np.radians(tilt_deg))
    plant.reset(q)
    return plant, q


def rotation_of(measurement):
    return Rotation.from_quat(measurement.quat_WO, scalar_first=True).as_matrix()


def stepped(plant, steps, torques=None, contacts=CONTACTS):
    """The block of steps with torques(measurement), or with those that are applied already."""
    block = Trace.allocate(steps, len(plant.joints), HANDS, contacts)
    for row in range(steps):
        m = plant.measure()
        block.t[row], block.p_WO[row], block.quat_WO[row] = m.t, m.p_WO, m.quat_WO
        if torques is not None:
            plant.apply(torques(m))
        plant.step()
    plant.contacts(block)
    return block


def push(plant, q_d, f_n, steps):
    """The block of steps with a feed-forward for normal forces f_n [N], (2,), around angles q_d."""

    def torques(m):
        R_WO = rotation_of(m)
        robot = ROBOT.at(m.q)
        p_WC, R_WC = FRAMES.points(R_WO, m.p_WO)[:HANDS], FRAMES.in_world(R_WO)[:HANDS]
        forces = np.einsum("nl,n->l", robot.contact_jacobians(p_WC, R_WC)[:, 2], f_n)
        impedance = BANDWIDTH**2 * (q_d - m.q) - 2.0 * BANDWIDTH * m.qd
        return robot.tau_g + forces + robot.mass_matrix() @ impedance

    return stepped(plant, steps, torques)
