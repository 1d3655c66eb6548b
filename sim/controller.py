"""The outer loop: from the measured state to the forces that the drives are to make."""

from __future__ import annotations

import time
from dataclasses import dataclass

from sim.channel import Channel, Setpoint
from sim.drives import Drives
from sim.grip import GripSchedule
from sim.ik import JointPath
from sim.observer import PoseObserver
from sim.path import ScrewPath
from sim.plant import Measurement
from sim.references import References
from sim.robot import RobotModel
from sim.scenario import Scenario
from sim.settings import Control
from sim.statics import Statics
from sim.world import NO_DEVIATION
from synthesis import (
    InfeasibleError,
    Problem,
    Solution,
    SolverError,
    Synthesizer,
    UnboundedError,
)
from synthesis.best_effort import BestEffort, best_effort
from synthesis.contact import Array, N


@dataclass(eq=False, slots=True)  # one every step, and a frozen one takes thrice as long
class Command:
    """What the controller asks of the motors, and why.

    Attributes:
        tau: Torques within the limits [N·m or N], (l,).
        saturated: Which torques were cut at their limit, (l,).
        phase: Index of the phase.
        q_ref: Reference angles [rad or m], (l,).
        tilt_ref: Reference tilt [rad].
        w_OC_C: Commanded wrenches on the object in contact axes [N, N·m], (m, 6).
        synthesis_s: Wall time of this tick's synthesis [s]; 0 where none was due.
        failed: Whether this tick's synthesis had no solution, so that the last forces, or with best
            effort those nearest to balance, are applied.
    """

    tau: Array
    saturated: Array
    phase: int
    q_ref: Array
    tilt_ref: float
    w_OC_C: Array
    synthesis_s: float
    failed: bool


class Controller:
    """Quasi-static force control along the path; the drives hold the last synthesised forces."""

    def __init__(
        self,
        scenario: Scenario,
        control: Control,
        robot: RobotModel,
        joint_path: JointPath,
        channel: Channel | None = None,
        grip: GripSchedule | None = None,
    ) -> None:
        """Takes over what it believes.

        Args:
            scenario: The scene.
            control: The settings.
            robot: Its model.
            joint_path: What the drives follow.
            channel: The wire to the drives; an ideal one if left out.
            grip: The least normal forces of the hands; the control's preload if left out.
        """
        self._control = control
        self._references = References(joint_path, scenario.physics.timestep)
        self._free = joint_path.schedule.free
        self._statics = Statics(scenario, control, robot, grip)
        self._synthesizer = Synthesizer()
        self._drives = Drives(scenario, control, robot)
        self._channel = channel or Channel(NO_DEVIATION)
        self._observer = PoseObserver(ScrewPath(scenario.path), control.pose_filter_s)
        self._tick = 0

    def command(self, measurement: Measurement) -> Command:
        """The torques for the next step."""
        target = self._references.at(measurement.t)
        synthesis_s, failed = 0.0, False
        if self._tick % self._control.solve_every == 0:
            self._drives.update_model(measurement.q)
            if not self._free[target.phase]:
                started = time.perf_counter()
                failed = not self._synthesize(measurement, target.tilt)
                synthesis_s = time.perf_counter() - started
        self._tick += 1
        setpoint = self._channel.receive(measurement.t)
        if setpoint is not None:
            self._drives.follow(setpoint)
        share = target.grip if self._control.feedforward else 0.0
        tau, saturated = self._drives.torques(measurement, target, share)
        return Command(
            tau=tau,
            saturated=saturated,
            q_ref=target.q,
            phase=target.phase,
            tilt_ref=target.tilt,
            w_OC_C=self._drives.w_held,
            synthesis_s=synthesis_s,
            failed=failed,
        )

    def _synthesize(self, measurement: Measurement, tilt_ref: float) -> bool:
        """Sends the forces of a solution, if there is one; returns whether there was."""
        m = measurement
        pose = self._observer.update(m.t, m.p_WO, m.quat_WO, tilt_ref)
        problem = self._statics.problem(*pose, tilt_ref)
        forces = self._solve(problem)
        if forces is None:
            return False
        assert problem.joints is not None
        J_n = problem.joints.J_C[:, N]
        setpoint = Setpoint(forces.tau - self._drives.tau_g, forces.w_OC_C, J_n)
        self._channel.send(measurement.t, setpoint)
        return isinstance(forces, Solution)

    def _solve(self, problem: Problem) -> Solution | BestEffort | None:
        try:
            return self._synthesizer.solve(problem)
        except (InfeasibleError, UnboundedError, SolverError):
            if not self._control.best_effort:
                return None
        try:
            return best_effort(problem)
        except (InfeasibleError, SolverError):
            return None
