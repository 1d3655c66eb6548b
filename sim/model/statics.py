"""From a measured state to the contact force synthesis problem, through the controller's belief."""

from __future__ import annotations

import mujoco
import numpy as np

from fulcrum.sim.geometry.object import GRAVITY, Object
from fulcrum.sim.model.contacts import ContactFrames, contacts
from fulcrum.sim.model.grip import GripSchedule, pressed
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.synthesis import Problem
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.contact import skew
from fulcrum.synthesis.problem import Gravity

# Contacts are made once for each of these steps, over which the least grip changes by 0.2 N [deg].
_GRIP_STEP_DEG = 0.5


class Statics:
    """The scenario's nominal object, contacts and robot as problems of the form (17)."""

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        robot: RobotModel | None,
        grip: GripSchedule | None = None,
    ) -> None:
        """Takes over the nominal scenario.

        Args:
            scenario: The scene.
            control: What the synthesis is told.
            robot: Without one the problems have no joints.
            grip: The least normal forces of the hands; the control's preload if left out.
        """
        self._robot = robot
        self._objective = control.objective
        nominal, end = contacts(scenario, control), np.radians(scenario.path.angle_deg)
        self._contacts = [nominal]
        if grip is not None:
            tilts = np.linspace(0.0, end, round(np.degrees(end) / _GRIP_STEP_DEG) + 1)
            self._contacts = [pressed(nominal, f_n) for f_n in grip.at(tilts)]
        self._rows_per_rad = (len(self._contacts) - 1) / end
        self._frames = ContactFrames(scenario)
        self._hands = len(scenario.hands)
        self._weight_W = np.array([0.0, 0.0, -scenario.object.mass * GRAVITY])
        center_O = np.asarray(scenario.object.center_of_mass)
        # Stacked over the moment about the object frame: the wrench of a force at the centre.
        self._at_center = np.vstack([np.eye(3), skew(center_O)])

    def problem(self, p_WO: Array, quat_WO: Array, tilt: float = 0.0) -> Problem:
        """The problem at the angles that the robot was last updated to.

        Args:
            p_WO: Position of the object [m], (3,).
            quat_WO: Its orientation, (4,), wxyz.
            tilt: Where it should be on the path [rad]: what the least grip depends on.
        """
        row = round(min(max(tilt * self._rows_per_rad, 0.0), len(self._contacts) - 1.0))
        R_WO = np.empty((3, 3))
        mujoco.mju_quat2Mat(R_WO.reshape(9), quat_WO)
        R_OC = self._frames.in_object(R_WO)
        p_WC = self._frames.points(R_WO, p_WO)
        n = self._hands
        return Problem(
            contacts=self._contacts[row],
            R_OC=R_OC,
            p_OC_O=self._frames.p_OC_O,
            w_ext_O=self._at_center.dot(R_WO.T.dot(self._weight_W)),
            joints=None if self._robot is None else self._robot.statics(p_WC[:n], R_WO @ R_OC[:n]),
            objective=self._objective,
        )


def gravity(thing: Object, R_WO: Array) -> Gravity:
    """The weight of an object at an orientation, (3, 3), in the object's axes."""
    return Gravity(
        weight=thing.mass * GRAVITY,
        direction_O=R_WO.T @ np.array([0.0, 0.0, -1.0]),
        center_O=np.asarray(thing.center_of_mass),
    )
