"""A scenario as a ``dm_env`` environment: joint torques in, states and contact forces out."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
from dm_control.rl import control
from dm_env import specs

from fulcrum.sim.model import RobotModel
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.motion import Schedule, plan_joints
from fulcrum.sim.plant import MujocoPlant
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.checks import positive

# Allowed difference of a number of steps from a whole number [-].
_WHOLE = 1e-6


class TiltTask(control.Task):
    """The task to tilt the object along the scenario's path.

    The action is the joint torques [N·m or N], (l,), bounded by their limits. Observations:

    - ``joint_positions``, ``joint_velocities``: (l,) [rad, rad/s].
    - ``object_pose``: position [m] and quaternion wxyz, (7,); ``object_twist``: (6,), linear first.
    - ``contact_forces``: force on the object in world axes [N] and torsional moment [N·m], (m, 4).

    Contact forces and the object's twist are from the last physics step; joints and pose are from
    after it. The reward is the share of the path's tilt that is reached, from 0 to 1.
    """

    def __init__(self, scenario: Scenario, plant: MujocoPlant, seed: int) -> None:
        self._plant = plant
        self._path = object_path(scenario.path)
        self._robot = RobotModel(scenario)
        self._start = plan_joints(scenario).start
        self._deviation = self._robot.start_deviation
        self._random = np.random.default_rng(seed)
        self._object = scenario.object.name
        # Twist and contact forces of the last physics step.
        hands, contacts = len(scenario.hands), len(scenario.contact_names)
        self._last = Trace.allocate(1, len(self._robot.joints), hands, contacts)

    def initialize_episode(self, physics: Any) -> None:
        """Put robot and object at their start, the joints with small random deviations."""
        deviation = self._deviation * self._random.normal(size=len(self._start))
        self._plant.place(self._start + deviation)
        self._last.f_W[:] = self._last.twist_WO[:] = 0.0

    def before_step(self, action: Array, physics: Any) -> None:
        """Apply the torques."""
        self._plant.apply(np.asarray(action))

    def after_step(self, physics: Any) -> None:
        """Read twist and contact forces of the last physics step, from the state before it."""
        thing = physics.named.data
        self._last.p_WO[:] = thing.xpos[self._object]
        self._last.quat_WO[:] = thing.xquat[self._object]
        self._plant.log()
        self._plant.contacts(self._last)

    def action_spec(self, physics: Any) -> specs.BoundedArray:
        """Return the specification of the action: joint torques within their limits."""
        robot = self._robot
        shape = (len(robot.joints),)
        names = "\t".join(robot.joints)
        return specs.BoundedArray(shape, np.float64, robot.tau_min, robot.tau_max, names)

    def get_observation(self, physics: Any) -> OrderedDict[str, Array]:
        """Return the observations by name."""
        measurement = self._plant.measure()
        return OrderedDict(
            joint_positions=measurement.q,
            joint_velocities=measurement.qd,
            object_pose=np.concatenate([measurement.p_WO, measurement.quat_WO]),
            object_twist=self._last.twist_WO[0].copy(),
            contact_forces=self._last.f_W[0].copy(),
        )

    def get_reward(self, physics: Any) -> float:
        """Return the share of the path's tilt that is reached [-]."""
        tilt = float(self._path.tilt(self._plant.measure().quat_WO))
        return float(np.clip(tilt / self._path.end, 0.0, 1.0))


def make_environment(
    scenario: Scenario, seed: int = 0, control_timestep: float | None = None
) -> control.Environment:
    """Return a scenario as an environment.

    Args:
        scenario: Scene.
        seed: Seed of the deviations of the start posture.
        control_timestep: Time between actions [s]; by default that between syntheses.

    Raises:
        InvalidInputError: The time between actions is no multiple of the physics step.
        PathError: The arms cannot follow the path.
    """
    if control_timestep is None:
        control_timestep = scenario.control.solve_every * scenario.physics.timestep
    positive("control_timestep", control_timestep)
    steps = control_timestep / scenario.physics.timestep
    if abs(steps - round(steps)) > _WHOLE or round(steps) < 1:
        valid = f"a multiple of the physics' {scenario.physics.timestep:g} s"
        raise InvalidInputError("control_timestep", control_timestep, valid)
    plant = MujocoPlant(scenario)
    return control.Environment(
        plant.physics,
        TiltTask(scenario, plant, seed),
        time_limit=Schedule(scenario).total_s,
        control_timestep=control_timestep,
        legacy_step=False,  # otherwise new contacts would be read with old forces
    )
