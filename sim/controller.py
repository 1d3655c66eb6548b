"""The outer loop: from the measured state to the forces that the drives are to make."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from sim.channel import Channel, Setpoint
from sim.clock import PathClock
from sim.drives import Drives
from sim.grip import GripSchedule
from sim.guard import Event, Mode, Supervisor
from sim.health import Health, Sent
from sim.ik import JointPath
from sim.observer import PoseObserver
from sim.path import ScrewPath
from sim.plant import Measurement
from sim.references import References, Target
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
from synthesis.contact import Array, Mask

# Time between looks at the run's health [s].
_CHECK_S = 0.01


@dataclass(eq=False, slots=True)  # one every step, and a frozen one takes thrice as long
class Command:
    """What the controller asks of the motors, and why.

    Attributes:
        tau: Torques within the limits [N·m or N], (l,).
        saturated: Which torques were cut at their limit, (l,).
        phase: Index of the phase.
        mode: What the run is doing.
        q_ref: Reference angles [rad or m], (l,).
        tilt_ref: Reference tilt [rad].
        w_OC_C: Commanded wrenches on the object in contact axes [N, N·m], (m, 6).
        synthesis_s: Wall time of this tick's synthesis [s]; 0 where none was due.
        failed: Whether this tick's synthesis had no solution, so that the last forces, or with best
            effort those nearest to balance, are applied.
    """

    tau: Array
    saturated: Mask
    phase: int
    mode: Mode
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
        self._control, schedule = control, joint_path.schedule
        timestep = scenario.physics.timestep
        self._references = References(joint_path, timestep)
        self._free, self._held = schedule.free, schedule.held
        # Once the grip has been let go for good there is nothing left to be lowered.
        self._last_held = max(schedule.held.nonzero()[0].tolist(), default=-1)
        self._statics = Statics(scenario, control, robot, grip)
        self._synthesizer = Synthesizer()
        self._drives = Drives(scenario, control, robot)
        self._channel = channel or Channel(NO_DEVIATION)
        self._observer = PoseObserver(ScrewPath(scenario.path), control.pose_filter_s)
        self._clock, self._total_s = PathClock(timestep), schedule.total_s
        self._supervisor = Supervisor(control.guard)
        self._health = Health(control.guard, scenario, robot, joint_path.start)
        self._tick, self._check_every = 0, max(1, round(_CHECK_S / timestep))
        # Since when no forces are found, and when a setpoint last arrived, or none was due [s].
        self._failing_t: float | None = None
        self._heard_t = 0.0
        self._q_stop: Array | None = None
        none = np.zeros(len(robot.joints))
        self._sent = Sent(none, np.zeros(len(none), bool), none)

    @property
    def events(self) -> tuple[Event, ...]:
        """What went wrong so far, and what was done about it."""
        return tuple(self._supervisor.events)

    def left_s(self, t: float) -> float:
        """How long the run still takes as things stand at a time [s]; 0 if it has ended."""
        supervisor, path_t = self._supervisor, t - self._clock.delay
        if supervisor.mode in (Mode.RUN, Mode.HOLD):
            return self._total_s - path_t
        return supervisor.left_s(t, path_t)

    def command(self, measurement: Measurement) -> Command:
        """The torques for the next step."""
        t, seen = measurement.t, self._health.accept(measurement)
        mode = self._supervisor.mode
        path_t = self._clock.at(t, self._supervisor.rate)
        target = self._references.at(path_t)
        if self._clock.rate != 1.0:
            target = target._replace(qd=self._clock.rate * target.qd)
        if self._supervisor.stands:
            self._q_stop = seen.q if self._q_stop is None else self._q_stop
            target = target._replace(q=self._q_stop, qd=np.zeros_like(target.qd))
        synthesis_s, failed, free = 0.0, False, bool(self._free[target.phase])
        if free:
            self._failing_t, self._heard_t = None, t
        if self._tick % self._control.solve_every == 0:
            self._drives.update_model(seen.q)
            if not free and self._health.sees_object(seen):
                started = time.perf_counter()
                forces = self._synthesize(seen, target.tilt)
                synthesis_s = time.perf_counter() - started
                failed = not isinstance(forces, Solution)
                if forces is not None:
                    self._failing_t = None
                elif self._failing_t is None:
                    self._failing_t = t
        self._receive(t, path_t)
        if self._tick % self._check_every == 0:
            self._check(seen, path_t, target)
        self._tick += 1
        share = target.grip * self._supervisor.grip(t) if self._control.feedforward else 0.0
        tau, saturated = self._drives.torques(seen, target, share, self._health.uncontrolled)
        self._sent = Sent(tau, saturated, self._drives.tau_pull)
        return Command(
            tau=tau,
            saturated=saturated,
            q_ref=target.q,
            phase=target.phase,
            mode=mode,
            tilt_ref=target.tilt,
            w_OC_C=self._drives.w_held,
            synthesis_s=synthesis_s,
            failed=failed,
        )

    def _receive(self, t: float, path_t: float) -> None:
        """Follows a setpoint that has arrived; while lowering without, what held on the way up."""
        setpoint, lowering = self._channel.receive(t), self._supervisor.mode is Mode.LOWER
        if setpoint is not None:
            self._heard_t = t
            self._drives.follow(setpoint)
            if not lowering:
                self._drives.remember(path_t)
        elif lowering and t - self._heard_t > self._control.guard.silence_s:
            self._drives.recall(path_t)

    def _check(self, seen: Measurement, path_t: float, target: Target) -> None:
        findings = self._health.check(
            seen,
            target,
            self._sent,
            held=bool(self._held[target.phase]),
            failing_s=0.0 if self._failing_t is None else seen.t - self._failing_t,
            silent_s=seen.t - self._heard_t,
        )
        lowerable = target.phase <= self._last_held
        self._supervisor.update(seen.t, findings, path_t, lowerable)

    def _synthesize(self, seen: Measurement, tilt_ref: float) -> Solution | BestEffort | None:
        """Sends the forces for a measured pose, if there are any."""
        pose = self._observer.update(seen.t, seen.p_WO, seen.quat_WO, tilt_ref)
        problem = self._statics.problem(*pose, tilt_ref)
        forces = self._solve(problem)
        if forces is not None:
            assert problem.joints is not None
            tau_f = forces.tau - self._drives.tau_g
            setpoint = Setpoint(tau_f, forces.w_OC_C, problem.joints.J_C)
            self._channel.send(seen.t, setpoint)
        return forces

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
