"""The outer control loop: it synthesises the forces for the drives from the measured state."""

from __future__ import annotations

import time
from dataclasses import replace

from fulcrum.sim.control.drives import Drives
from fulcrum.sim.control.guard import Supervisor
from fulcrum.sim.control.health import Health, Sent
from fulcrum.sim.control.observer import PoseObserver
from fulcrum.sim.model import GripSchedule, RobotModel, Statics, inertial_wrenches
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.motion import JointPath, PathClock, References
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.sim.signals import Command, Event, Measurement, Mode, Setpoint, Target
from fulcrum.sim.world import NO_DEVIATION, Channel
from fulcrum.synthesis import (
    InfeasibleError,
    Problem,
    Solution,
    SolverError,
    Synthesizer,
    UnboundedError,
)
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.best_effort import BestEffort, best_effort

# Time between checks of the run's health [s].
_CHECK_S = 0.01


class ForceController:
    """Quasi-static force control along the path; the drives apply the last synthesised forces.

    Implements :class:`sim.control.protocol.Controller`. Call :meth:`reset` first.
    """

    def __init__(
        self,
        control: Control,
        joint_path: JointPath,
        grip: GripSchedule | None = None,
        channel: Channel | None = None,
        best_effort: bool = False,
    ) -> None:
        """Store settings and plan.

        Args:
            control: Settings of the controller.
            joint_path: Joint path that the drives follow.
            grip: Least normal forces of the hands; by default the preload of the control.
            channel: Connection to the drives; by default an ideal one.
            best_effort: Whether to apply the forces nearest to balance where no forces balance the
                object. Otherwise the last forces that balanced it stay.
        """
        self._control, self._joint_path, self._grip = control, joint_path, grip
        self._channel, self._best_effort = channel or Channel(NO_DEVIATION), best_effort

    def reset(self, scenario: Scenario, robot: RobotModel, seed: int) -> None:
        """See :meth:`Controller.reset`; nothing here is random."""
        control, joint_path, timestep = self._control, self._joint_path, scenario.physics.timestep
        schedule = joint_path.schedule
        self._scenario, self._robot, self._path = scenario, robot, object_path(scenario.path)
        self._references = References(joint_path, timestep)
        self._free, self._held = schedule.free.tolist(), schedule.held.tolist()
        # After the last phase with full grip there is no object left to lower.
        self._last_held = max(schedule.held.nonzero()[0].tolist(), default=-1)
        self._statics = Statics(scenario, control, self._grip)
        self._synthesizer = Synthesizer()
        self._drives = Drives(scenario, control, robot)
        self._observer = PoseObserver(self._path, control.pose_filter_s)
        self._clock, self._total_s = PathClock(timestep), schedule.total_s
        self._supervisor = Supervisor(control.guard)
        self._health = Health(control.guard, scenario, robot, joint_path.start)
        self._tick, self._check_every = 0, max(1, round(_CHECK_S / timestep))
        # State of the robots at the last synthesis.
        self._state = robot.at(joint_path.start)
        # Time of the first synthesis without forces; last time at which a setpoint arrived, or
        # none was due [s].
        self._failing_t: float | None = None
        self._heard_t = 0.0
        self._q_stop: Array | None = None

    @property
    def events(self) -> tuple[Event, ...]:
        """See :meth:`Controller.events`."""
        return tuple(self._supervisor.events)

    def left_s(self, t: float) -> float:
        """See :meth:`Controller.left_s`."""
        supervisor, path_t = self._supervisor, t - self._clock.delay
        if supervisor.mode in (Mode.RUN, Mode.HOLD):
            return self._total_s - path_t
        return supervisor.left_s(t, path_t)

    def command(self, measurement: Measurement) -> Command:
        """See :meth:`Controller.command`."""
        supervisor, clock, drives = self._supervisor, self._clock, self._drives
        t, seen, mode = measurement.t, self._health.accept(measurement), supervisor.mode
        path_t = clock.at(t, supervisor.rate)
        target = self._references.at(path_t)
        if clock.rate != 1.0 or clock.change != 0.0:
            target = target.on_clock(clock.rate, clock.change)
        if supervisor.stands:
            self._q_stop = seen.q if self._q_stop is None else self._q_stop
            target = Target(target.phase, target.tilt, target.grip, self._q_stop, 0.0 * target.qd)
        synthesis_s, failed, free = 0.0, False, self._free[target.phase]
        if free:
            self._failing_t, self._heard_t = None, t
        if self._tick % self._control.solve_every == 0:
            self._state = self._robot.at(seen.q)
            drives.update_model(self._state, target if self._control.inertia else None)
            if not free and self._health.sees_object(seen):
                started = time.perf_counter()
                forces = self._synthesize(seen, target)
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
        share = target.grip * supervisor.grip(t) if self._control.feedforward else 0.0
        tau, saturated = drives.torques(seen, target, share, self._health.uncontrolled)
        return Command(
            tau=tau,
            saturated=saturated,
            q_ref=target.q,
            phase=target.phase,
            mode=mode,
            tilt_ref=target.tilt,
            rate_ref=target.rate,
            w_commanded_C=drives.w_held,
            synthesis_s=synthesis_s,
            failed=failed,
        )

    def _receive(self, t: float, path_t: float) -> None:
        """Follow a new setpoint; when lowering without one, use that of the way up."""
        setpoint, lowering = self._channel.receive(t), self._supervisor.mode is Mode.LOWER
        if setpoint is not None:
            self._heard_t = t
            self._drives.follow(setpoint)
            if not lowering:
                self._drives.remember(path_t)
        elif lowering and t - self._heard_t > self._control.guard.silence_s:
            self._drives.recall(path_t)

    def _check(self, seen: Measurement, path_t: float, target: Target) -> None:
        drives = self._drives
        findings = self._health.check(
            seen,
            self._state,
            target,
            Sent(drives.tau, drives.saturated, drives.tau_pull),
            held=self._held[target.phase],
            failing_s=0.0 if self._failing_t is None else seen.t - self._failing_t,
            silent_s=seen.t - self._heard_t,
        )
        lowerable = target.phase <= self._last_held
        self._supervisor.update(seen.t, findings, path_t, lowerable)

    def _synthesize(self, seen: Measurement, target: Target) -> Solution | BestEffort | None:
        """Find the forces for a measured pose and send them to the drives."""
        pose = self._observer.update(seen.t, seen.p_WO, seen.quat_WO, target.tilt)
        problem = self._statics.problem(self._state, *pose, target.tilt)
        if self._control.inertia:
            problem = self._moving(problem, target)
        forces = self._solve(problem)
        if forces is not None:
            assert problem.joints is not None
            tau_f = forces.tau - problem.joints.tau_g
            setpoint = Setpoint(tau_f, forces.w_OC_C, problem.joints.J_C)
            self._channel.send(seen.t, setpoint)
        return forces

    def _moving(self, problem: Problem, target: Target) -> Problem:
        """Return the problem with the inertial loads of object and robot added."""
        assert problem.joints is not None
        w_a, w_b = inertial_wrenches(self._scenario, self._path, target.tilt)
        w_ext_O = problem.w_ext_O - target.acceleration * w_a - target.rate**2 * w_b
        tau_g = self._drives.tau_g + self._robot.damping * target.qd
        return replace(problem, w_ext_O=w_ext_O, joints=replace(problem.joints, tau_g=tau_g))

    def _solve(self, problem: Problem) -> Solution | BestEffort | None:
        try:
            return self._synthesizer.solve(problem)
        except (InfeasibleError, UnboundedError, SolverError):
            if not self._best_effort:
                return None
        try:
            return best_effort(problem)
        except (InfeasibleError, SolverError):
            return None
