"""From a measured state to the contact force synthesis problem, through the controller's belief."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.contacts import ContactFrames, contacts
from sim.robot import RobotModel
from sim.scenario import GRAVITY, Scenario
from sim.settings import Control
from synthesis import Problem
from synthesis.contact import Array, skew


class Statics:
    """The scenario's nominal object, contacts and robot as problems of the form (17)."""

    def __init__(self, scenario: Scenario, control: Control, robot: RobotModel | None) -> None:
        """Takes over the nominal scenario; without a robot the problems have no joints."""
        self._robot = robot
        self._objective = control.objective
        self._contacts = contacts(scenario, control)
        self._frames = ContactFrames(scenario)
        self._hands = len(scenario.hands)
        self._weight_W = np.array([0.0, 0.0, -scenario.object.mass * GRAVITY])
        center_O = np.asarray(scenario.object.center_of_mass)
        # Stacked over the moment about the object frame: the wrench of a force at the centre.
        self._at_center = np.vstack([np.eye(3), skew(center_O)])

    def problem(self, p_WO: Array, quat_WO: Array) -> Problem:
        """The problem at a pose of the object and the angles that the robot was last updated to."""
        R_WO = np.empty((3, 3))
        mujoco.mju_quat2Mat(R_WO.reshape(9), quat_WO)
        R_OC = self._frames.in_object(R_WO)
        p_WC = self._frames.points(R_WO, p_WO)
        n = self._hands
        return Problem(
            contacts=self._contacts,
            R_OC=R_OC,
            p_OC_O=self._frames.p_OC_O,
            w_ext_O=self._at_center.dot(R_WO.T.dot(self._weight_W)),
            joints=None if self._robot is None else self._robot.statics(p_WC[:n], R_WO @ R_OC[:n]),
            objective=self._objective,
        )
