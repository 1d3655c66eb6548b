"""The contact force synthesis problem at a measured state, from the controller's models."""

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

# Step of the tilt for which contacts are prepared, with the largest grip within the step [deg].
_GRIP_STEP_DEG = 0.5
# Differences of grip below this are solver noise [N].
_SAME_GRIP = 1e-4
# Largest deviation of a quaternion's squared length from 1 that is not normalised away [-]; the
# rotation matrix has an error of the same size.
_UNIT_LENGTH = 1e-9


class Statics:
    """Problems of the form (17) for the scenario's nominal object, contacts and robots."""

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        grip: GripSchedule | None = None,
    ) -> None:
        """Prepare the contacts of the nominal scenario.

        Args:
            scenario: The scene.
            control: Settings of the synthesis: friction factor, preload, objective.
            grip: Least normal forces of the hands; the control's preload if left out.
        """
        self._objective = control.objective
        nominal, end = contacts(scenario, control), np.radians(scenario.path.angle_deg)
        self._contacts = [nominal]
        if grip is not None:
            tilts = np.linspace(0.0, end, round(np.degrees(end) / _GRIP_STEP_DEG) + 1)
            half = 0.5 * end / (len(tilts) - 1)
            most = np.array([grip.largest(tilt - half, tilt + half) for tilt in tilts.tolist()])
            middle = grip.at(tilts)
            # Differences within the solver's noise are ignored.
            rows = np.where(grip.least & (most > middle + _SAME_GRIP), most, middle)
            self._contacts = [pressed(nominal, f_n) for f_n in rows]
        self._rows_per_rad = (len(self._contacts) - 1) / end
        self._frames = ContactFrames(scenario)
        self._hands = len(scenario.hands)
        self._weight_W = np.array([0.0, 0.0, -scenario.object.mass * GRAVITY])
        center_O = np.asarray(scenario.object.center_of_mass)
        # Maps a force at the centre of mass to its wrench about the object frame.
        self._at_center = np.vstack([np.eye(3), skew(center_O)])

    def problem(
        self, robot: RobotState | None, p_WO: Array, quat_WO: Array, tilt: float = 0.0
    ) -> Problem:
        """Return the problem at a state.

        Args:
            robot: The robots at their joint angles; without them the problem has no joints.
            p_WO: Position of the object [m], (3,).
            quat_WO: Orientation of the object, (4,), wxyz, of any length > 0: trackers round it.
            tilt: Reference tilt [rad], which selects the least grip.
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
    """Return the weight of an object at an orientation, (3, 3), in the object's axes."""
    return Gravity(
        weight=thing.mass * GRAVITY,
        direction_O=R_WO.T @ np.array([0.0, 0.0, -1.0]),
        center_O=np.asarray(thing.center_of_mass),
    )
