"""Joint path for the object's path by inverse kinematics with mink; names limits that stop it."""

from __future__ import annotations

from typing import NamedTuple

import mink
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.assets import velocity_limits
from fulcrum.sim.model import (
    DETECTION,
    ContactFrames,
    ObjectMotion,
    collision_pairs,
    compose,
    distance,
    joint_ranges,
    tip_geom,
    tip_site,
)
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.motion.joint_path import JointGrid, JointPath, PathError
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import Array

_ITERATIONS = 50
# Pose error at which a step counts as solved [m and rad].
_SOLVED = 1e-9
# Gauss-Newton damping: small against the squared singular values of the task (> 0.01).
_DAMPING = 1e-8
# Longest step of a joint in the search of the start [rad or m]. With longer ones the linear model
# fails: an arm out of reach ends far from its target, at limits that are not the cause.
_START_STEP = 0.05
# Distance within which a limit counts as reached [rad, m, or share of the speed limit].
_AT_LIMIT = 1e-3
_NAMED_COLLISIONS = 3
# Damping of joints that should keep still: large against that of the others, which move instead.
_STILL_DAMPING = 1e-2


def plan_joints(
    scenario: Scenario, solved: float = _SOLVED, grid: JointGrid | None = None
) -> JointPath:
    """Return joint angles with which all hands follow the manoeuvre within all limits.

    The limits are those of joint angles, speeds and collisions.

    Args:
        scenario: The scene.
        solved: Pose error at which a step counts as solved [m and rad].
        grid: Steps of the joint path; the defaults of :class:`JointGrid` if left out.

    Raises:
        PathError: A limit stops the arms; names it and the tilt.
    """
    return _Follower(scenario, solved, grid or JointGrid()).follow()


class _Target(NamedTuple):
    tilt: float  # [rad]
    gap: float  # [m]


class _Follower:
    def __init__(self, scenario: Scenario, solved: float, grid: JointGrid) -> None:
        self._scenario, self._path = scenario, object_path(scenario.path)
        self._solved, self._grid = solved, grid
        self._done, self._steps = 0, 1
        self._schedule = Schedule(scenario)
        self._frames = ContactFrames(scenario)
        spec = compose(scenario, ObjectMotion.POSED)
        # mink ignores geoms that cannot collide in the physics, which does not run in this scene.
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 1
        self._model = model = spec.compile()
        self._object = model.body(scenario.object.name).mocapid[0]
        self._configuration = mink.Configuration(model)
        self._tasks = [
            mink.FrameTask(tip_site(hand), "site", position_cost=1.0, orientation_cost=1.0)
            for hand in scenario.hands
        ]
        still = np.zeros(model.nv)
        still[[model.joint(name).dofadr[0] for name in scenario.still]] = 1.0
        self._damping = mink.DampingTask(model, np.sqrt(_STILL_DAMPING) * still)
        self._radii = [float(model.geom(tip_geom(hand)).size[0]) for hand in scenario.hands]
        self._motor_joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
        speeds = velocity_limits(model)
        self._qd_max = np.array([speeds[model.joint(j).name] for j in range(model.njnt)])
        q = np.array([scenario.posture[model.joint(j).name] for j in range(model.njnt)])
        self._configuration.update(q)
        self._pose_object(0.0)
        self._collisions = mink.CollisionAvoidanceLimit(
            model,
            collision_pairs(scenario, model, self._configuration.data),
            minimum_distance_from_collisions=grid.clearance_m,
            collision_detection_distance=DETECTION,
        )

    def follow(self) -> JointPath:
        phases = self._schedule.phases
        touched = next((i for i, p in enumerate(phases) if p.gap == 0.0), len(phases) - 1)
        # The posture at the first contact is solved first; the approach is planned back from it.
        self._steps = 1 + sum(len(self._targets(i)[1]) - 1 for i in range(len(phases)))
        self._reach(_Target(phases[touched].tilt * self._path.end, phases[touched].gap), None)
        holding = self._configuration.q.copy()
        planned = [self._follow(i, backwards=True) for i in range(touched, -1, -1)][::-1]
        self._configuration.update(holding)
        planned += [self._follow(i) for i in range(touched + 1, len(phases))]
        progress, q = zip(*planned, strict=True)
        low, high = joint_ranges(self._model)[self._motor_joints].T
        every = np.concatenate(q)
        clearance = np.minimum(every - low, high - every).min(axis=0)
        return JointPath(self._schedule, tuple(progress), tuple(q), clearance)

    def _follow(self, index: int, backwards: bool = False) -> tuple[Array, Array]:
        """Return a phase's grid of progresses and the motors' angles, starting at the present."""
        grid, targets = self._targets(index)
        durations = np.diff(self._schedule.times(index, grid))
        if backwards:
            targets, durations = targets[::-1], durations[::-1]
        postures = [self._configuration.q.copy()]
        for target, duration in zip(targets[1:], durations, strict=True):
            self._reach(target, float(duration))
            postures.append(self._configuration.q.copy())
        q = np.array(postures)[:, self._motor_joints]
        return grid, q[::-1] if backwards else q

    def _targets(self, index: int) -> tuple[Array, list[_Target]]:
        """Return a phase's grid of progresses and the target at each of them."""
        phase, before = self._schedule.phases[index], self._schedule.before(index)
        own = self._grid
        degrees = abs(phase.tilt - before.tilt) * np.degrees(self._path.end)
        distance = abs(phase.gap - before.gap)
        steps = max(own.least, int(np.ceil(max(degrees / own.tilt_deg, distance / own.gap_m))))
        grid = np.linspace(0.0, 1.0, steps + 1)
        tilts = self._path.end * (before.tilt + (phase.tilt - before.tilt) * grid)
        gaps = before.gap + (phase.gap - before.gap) * grid
        return grid, [_Target(float(t), float(g)) for t, g in zip(tilts, gaps, strict=True)]

    def _reach(self, target: _Target, duration: float | None) -> None:
        """Bring the hands to a target, within a duration [s] if one is given."""
        self._pose_object(target.tilt)
        for task, pose in zip(self._tasks, self._tip_poses(target), strict=True):
            task.set_target(pose)
        # Without a duration each iteration is a step of 1 s, so speed limits are limits of steps.
        dt, speeds = 1.0, np.full_like(self._qd_max, _START_STEP)
        if duration is not None:
            dt, speeds = duration, self._qd_max
        names = [self._model.joint(j).name for j in range(self._model.njnt)]
        limits: list[mink.Limit] = [
            mink.ConfigurationLimit(self._model),
            mink.VelocityLimit(self._model, dict(zip(names, speeds, strict=True))),
            self._collisions,
        ]
        start = self._configuration.q.copy()
        for _ in range(_ITERATIONS):
            if self._error() < self._solved:
                break
            try:
                tasks = [*self._tasks, self._damping]
                velocity = mink.solve_ik(
                    self._configuration, tasks, dt, "daqp", _DAMPING, limits=limits
                )
            except mink.NoSolutionFound:
                break
            self._configuration.integrate_inplace(velocity, dt)
        moved = np.abs(self._configuration.q - start)
        too_fast = np.zeros(len(moved), bool)
        if duration is not None:
            too_fast = moved >= (1.0 - _AT_LIMIT) * duration * self._qd_max
        if not self._error() < self._solved or too_fast.any():  # also true for NaN
            reasons, share = self._reasons(too_fast), self._done / self._steps
            raise PathError(target.tilt, target.gap, self._error(), reasons, share)
        self._done += 1

    def _tip_poses(self, target: _Target) -> list[mink.SE3]:
        """Return the poses of the hands' tips in the world, at the gap from their contacts."""
        R_WO, p_WO = self._path.pose(target.tilt)
        R_WC = self._frames.in_world(R_WO)
        p_WC = self._frames.points(R_WO, p_WO)
        poses = []
        for R, p, radius in zip(R_WC, p_WC, self._radii, strict=False):
            orientation = mink.SO3(Rotation.from_matrix(R).as_quat(scalar_first=True))
            center = p - (radius + target.gap) * R[:, 2]
            poses.append(mink.SE3.from_rotation_and_translation(orientation, center))
        return poses

    def _error(self) -> float:
        return max(
            float(np.abs(task.compute_error(self._configuration)).max()) for task in self._tasks
        )

    def _reasons(self, too_fast: Array) -> list[str]:
        model, data, q = self._model, self._configuration.data, self._configuration.q
        reasons = []
        for j in range(model.njnt):
            name, (low, high) = model.joint(j).name, joint_ranges(model)[j]
            unit = "m" if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE else "rad"
            if too_fast[j]:
                reasons.append(f"{name} at its speed limit {self._qd_max[j]:g} {unit}/s")
            if q[j] - low < _AT_LIMIT:
                reasons.append(f"{name} at its lower limit {low:.3f} {unit}")
            if high - q[j] < _AT_LIMIT:
                reasons.append(f"{name} at its upper limit {high:.3f} {unit}")
        near_m = self._grid.clearance_m
        near = sorted(
            (apart, first, second)
            for first, second in self._collisions.geom_id_pairs
            if (apart := distance(model, data, first, second)) < near_m + _AT_LIMIT
        )
        reasons += [
            f"{model.geom(first).name} within {1e3 * near_m:g} mm of {model.geom(second).name}"
            for _, first, second in near[:_NAMED_COLLISIONS]
        ]
        return reasons or ["out of reach of the arms"]

    def _pose_object(self, tilt: float) -> None:
        R_WO, p_WO = self._path.pose(tilt)
        data = self._configuration.data
        data.mocap_pos[self._object] = p_WO
        data.mocap_quat[self._object] = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
        self._configuration.update()
