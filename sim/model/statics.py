"""From a measured state to the contact force synthesis problem, through the controller's belief."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.geometry import GRAVITY, Object, quaternion
from fulcrum.sim.model.contacts import ContactFrames, contacts
from fulcrum.sim.model.grip import GripSchedule, pressed
from fulcrum.sim.model.robot_model import RobotState
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis import Problem
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.contact import skew
from fulcrum.synthesis.problem import Gravity

# Contacts are made once for each of these steps, with the largest grip within each [deg].
_GRIP_STEP_DEG = 0.5
# Grips that differ by less are the same [N].
_SAME_GRIP = 1e-4
# Quaternions that are nearer to length 1 are as their source made them: their rotation matrices
# are off by as much [-].
_UNIT_LENGTH = 1e-9


class Statics:
    """The scenario's nominal object, contacts and robot as problems of the form (17)."""

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        grip: GripSchedule | None = None,
    ) -> None:
        """Takes over the nominal scenario.

        Args:
            scenario: The scene.
            control: What the synthesis is told.
            grip: The least normal forces of the hands; the control's preload if left out.
        """
        self._objective = control.objective
        nominal, end = contacts(scenario, control), np.radians(scenario.path.angle_deg)
        self._contacts = [nominal]
        if grip is not None:
            tilts = np.linspace(0.0, end, round(np.degrees(end) / _GRIP_STEP_DEG) + 1)
            half = 0.5 * end / (len(tilts) - 1)
            most = np.array([grip.largest(tilt - half, tilt + half) for tilt in tilts.tolist()])
            middle = grip.at(tilts)
            # A difference within the solver's noise is none.
            rows = np.where(grip.least & (most > middle + _SAME_GRIP), most, middle)
            self._contacts = [pressed(nominal, f_n) for f_n in rows]
        self._rows_per_rad = (len(self._contacts) - 1) / end
        self._frames = ContactFrames(scenario)
        self._hands = len(scenario.hands)
        self._weight_W = np.array([0.0, 0.0, -scenario.object.mass * GRAVITY])
        center_O = np.asarray(scenario.object.center_of_mass)
        # Stacked over the moment about the object frame: the wrench of a force at the centre.
        self._at_center = np.vstack([np.eye(3), skew(center_O)])

    def problem(
        self, robot: RobotState | None, p_WO: Array, quat_WO: Array, tilt: float = 0.0
    ) -> Problem:
        """Return the problem at a state.

        Args:
            robot: The robots at their joint angles; without them the problem has no joints.
            p_WO: Position of the object [m], (3,).
            quat_WO: Its orientation, (4,), wxyz; of any length, for trackers round their numbers.
            tilt: Where it should be on the path [rad]: what the least grip depends on.
        """
        row = round(min(max(tilt * self._rows_per_rad, 0.0), len(self._contacts) - 1.0))
        if abs(quat_WO.dot(quat_WO) - 1.0) > _UNIT_LENGTH:
            quat_WO = quaternion.normalized(quat_WO)
        R_WO = quaternion.matrix(quat_WO)
        R_OC = self._frames.in_object(R_WO)
        p_WC = self._frames.points(R_WO, p_WO)
        n = self._hands
        return Problem(
            contacts=self._contacts[row],
            R_OC=R_OC,
            p_OC_O=self._frames.p_OC_O,
            w_ext_O=self._at_center.dot(R_WO.T.dot(self._weight_W)),
            joints=None if robot is None else robot.statics(p_WC[:n], R_WO @ R_OC[:n]),
            objective=self._objective,
        )


def gravity(thing: Object, R_WO: Array) -> Gravity:
    """The weight of an object at an orientation, (3, 3), in the object's axes."""
    return Gravity(
        weight=thing.mass * GRAVITY,
        direction_O=R_WO.T @ np.array([0.0, 0.0, -1.0]),
        center_O=np.asarray(thing.center_of_mass),
    )
