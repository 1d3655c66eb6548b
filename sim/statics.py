"""From a measured state to the contact force synthesis problem, through the controller's belief."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from sim.contacts import ContactFrames, contacts
from sim.robot import RobotModel
from sim.scenario import GRAVITY, Scenario
from sim.settings import Control
from synthesis import Problem
from synthesis.contact import Array


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
        self._center_O = np.asarray(scenario.object.center_of_mass)

    def problem(self, p_WO: Array, quat_WO: Array) -> Problem:
        """The problem at a pose of the object and the angles that the robot was last updated to."""
        R_WO = Rotation.from_quat(quat_WO, scalar_first=True).as_matrix()
        R_OC = self._frames.in_object(R_WO)
        p_WC = self._frames.points(R_WO, p_WO)
        weight_O = R_WO.T @ self._weight_W
        n = self._hands
        return Problem(
            contacts=self._contacts,
            R_OC=R_OC,
            p_OC_O=self._frames.p_OC_O,
            w_ext_O=np.concatenate([weight_O, np.cross(self._center_O, weight_O)]),
            joints=None if self._robot is None else self._robot.statics(p_WC[:n], R_WO @ R_OC[:n]),
            objective=self._objective,
        )
