"""The contact force synthesis problems along a scenario's path, without a simulation."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.model import GripSchedule, RobotModel, Statics, gravity
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.motion import JointPath, plan_joints
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis import InvalidInputError, Problem
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.problem import Gravity


class PathProblems:
    """Problems along the path: the object on it, the arms in the planned postures.

    Attributes:
        scenario: The scene.
        end_deg: Tilt at the end of the path [deg].
        joint_path: Joint angles along the path; None without joints.
    """

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        with_joints: bool = True,
        joint_path: JointPath | None = None,
        grip: GripSchedule | None = None,
        robot: RobotModel | None = None,
    ) -> None:
        """Plan the joint path if it is not given.

        Args:
            scenario: The scene.
            control: Settings of the synthesis: friction factor, preload, objective.
            with_joints: Whether the arms are part of the problem: (15) and (16).
            joint_path: Joint path of the scenario; planned if left out.
            grip: Least normal forces of the hands; the control's preload if left out.
            robot: Model of the scenario's robots; built if left out.

        Raises:
            PathError: The arms cannot follow the path.
        """
        self.scenario = scenario
        self._path = object_path(scenario.path)
        self.end_deg = float(np.degrees(self._path.end))
        self._robot = (robot or RobotModel(scenario)) if with_joints else None
        self.joint_path = joint_path or plan_joints(scenario) if with_joints else None
        self._statics = Statics(scenario, control, grip)

    def tilts(self, step_deg: float) -> Array:
        """Return evenly spaced tilts from start to end [deg], at most a step apart."""
        return np.linspace(0.0, self.end_deg, int(np.ceil(self.end_deg / step_deg - 1e-9)) + 1)

    def problem(self, tilt_deg: float) -> Problem:
        """Return the problem at a tilt [deg].

        Raises:
            InvalidInputError: The tilt is not on the path.
        """
        tilt = self._tilt(tilt_deg)
        state = None
        if self._robot is not None and self.joint_path is not None:
            state = self._robot.at(self.joint_path.holding(tilt))
        R_WO, p_WO = self._path.pose(tilt)
        quat_WO = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
        return self._statics.problem(state, p_WO, quat_WO, tilt)

    def gravity(self, tilt_deg: float) -> Gravity:
        """Return the object's weight at a tilt [deg]."""
        return gravity(self.scenario.object, self.orientation(tilt_deg))

    def orientation(self, tilt_deg: float) -> Array:
        """Return the orientation R_WO of the object, (3, 3), at a tilt [deg]."""
        return self._path.pose(self._tilt(tilt_deg))[0]

    def _tilt(self, tilt_deg: float) -> float:
        if not 0.0 <= tilt_deg <= self.end_deg + 1e-9:
            raise InvalidInputError("tilt", tilt_deg, f"from 0 to {self.end_deg:g} deg")
        return min(float(np.radians(tilt_deg)), self._path.end)
