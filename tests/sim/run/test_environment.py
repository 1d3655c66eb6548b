"""The environment keeps dm_env's contract and is the same plant as the closed loop's."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from absl.testing import absltest
from dm_env import StepType
from dm_env.test_utils import EnvironmentTestMixin
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.run.environment import make_environment
from fulcrum.sim.scenario.phases import Phase
from fulcrum.synthesis import InvalidInputError
from tests.helpers.runs import NAMES

BOX = scenario("box-tilt")
LOOP_STEPS = 300

each_scenario = pytest.mark.parametrize("name", NAMES)


# --- the contract ---


class Conformance(EnvironmentTestMixin):
    """dm_env's own tests; those of each scenario are made below."""

    def make_object_under_test(self):
        return make_environment(self.scene, control_timestep=0.5)

    def make_action_sequence(self):
        """Limp arms, past the end of the episode."""
        steps = int(np.ceil(Schedule(self.scene).total_s / 0.5)) + 2
        return itertools.repeat(np.zeros(self.environment.action_spec().shape), steps)


def conformance_of(scene):
    name = f"Test{scene.name.title().replace('-', '')}"
    return type(name, (Conformance, absltest.TestCase), {"scene": scene})


for _scene in scenarios().values():
    _case = conformance_of(_scene)
    globals()[_case.__name__] = _case
del _case  # or pytest would collect the last one twice


def test_an_environment_with_a_wrong_observation_is_caught_by_the_contract():
    case = conformance_of(BOX)("test_reset")
    case.setUp()
    step = case.environment.reset()
    case.assertValidStep(step)
    short = {**step.observation, "joint_positions": step.observation["joint_positions"][1:]}
    with pytest.raises((ValueError, AssertionError)):
        case.assertValidStep(step._replace(observation=type(step.observation)(short)))
    case.tearDown()


@each_scenario
def test_an_episode_ends_with_the_schedule(name):
    scene = scenario(name)
    environment = make_environment(scene, control_timestep=0.5)
    action = np.zeros(environment.action_spec().shape)
    environment.reset()
    steps = [environment.step(action) for _ in range(int(np.ceil(Schedule(scene).total_s / 0.5)))]
    assert [s.step_type for s in steps[:-1]] == [StepType.MID] * (len(steps) - 1)
    assert steps[-1].step_type is StepType.LAST
    # No fall ends an episode early, and its end is the schedule's, not a terminal state.
    assert steps[-1].discount == 1.0


# --- actions, observations, reward ---


@each_scenario
def test_actions_are_torques_within_their_limits(name):
    belief = RobotModel(scenario(name))
    spec = make_environment(scenario(name)).action_spec()
    assert spec.shape == (len(belief.joints),)
    np.testing.assert_array_equal(spec.minimum, belief.tau_min)
    np.testing.assert_array_equal(spec.maximum, belief.tau_max)
    assert spec.name.split("\t") == list(belief.joints)


@each_scenario
def test_observations_have_their_names_and_shapes(name):
    scene = scenario(name)
    joints, contacts = len(scene.posture), len(scene.contact_names)
    environment = make_environment(scene)
    expected = {
        "joint_positions": (joints,),
        "joint_velocities": (joints,),
        "object_pose": (7,),
        "object_twist": (6,),
        "contact_forces": (contacts, 4),
    }
    assert {n: s.shape for n, s in environment.observation_spec().items()} == expected
    observation = environment.reset().observation
    assert {n: v.shape for n, v in observation.items()} == expected


@each_scenario
def test_an_episode_starts_at_rest_at_the_scenario_s_start(name):
    scene = scenario(name)
    observation = make_environment(scene).reset().observation
    start = [*scene.path.start.position, *scene.path.start.quaternion]
    np.testing.assert_allclose(observation["object_pose"], start, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(observation["joint_velocities"], 0.0)
    np.testing.assert_array_equal(observation["object_twist"], 0.0)
    np.testing.assert_array_equal(observation["contact_forces"], 0.0)


@each_scenario
def test_the_default_action_lasts_as_long_as_a_synthesis(name):
    scene = scenario(name)
    expected = scene.control.solve_every * scene.physics.timestep
    assert make_environment(scene).control_timestep() == pytest.approx(expected, rel=1e-12)
    coarse = make_environment(scene, control_timestep=0.02)
    assert coarse.control_timestep() == pytest.approx(0.02, rel=1e-12)


@pytest.mark.parametrize("value", [0.0, -0.01, np.nan, np.inf])
def test_a_senseless_time_between_actions_is_refused_by_name(value):
    with pytest.raises(InvalidInputError, match=rf"^control_timestep: got {value}; valid is"):
        make_environment(BOX, control_timestep=value)


def reward_at(environment, scene, tilt):
    """Reward with the object on its path at a tilt [rad]."""
    R_WO, p_WO = ScrewPath(scene.path).pose(tilt)
    joint = environment.physics.data.joint(scene.object.name)
    joint.qpos[:] = [*p_WO, *Rotation.from_matrix(R_WO).as_quat(scalar_first=True)]
    return environment.task.get_reward(environment.physics)


@each_scenario
def test_reward_is_the_share_of_the_tilt(name):
    scene = scenario(name)
    environment = make_environment(scene)
    environment.reset()
    end = np.radians(scene.path.angle_deg)
    shares = np.array([0.0, 0.1, 0.25, 0.5, 0.9, 1.0])
    rewards = [reward_at(environment, scene, share * end) for share in shares]
    # The tilt is read from a quaternion.
    np.testing.assert_allclose(rewards, shares, rtol=0, atol=1e-12)
    # It stays within 0 and 1.
    assert reward_at(environment, scene, -0.3) == 0.0
    assert reward_at(environment, scene, end + 0.3) == 1.0


# --- seeds ---


def episode(scene, seed, steps=20):
    """Observations of an episode with constant torques, one row per step."""
    environment = make_environment(scene, seed)
    action = 0.1 * environment.action_spec().maximum
    rows = [environment.reset(), *(environment.step(action) for _ in range(steps))]
    return np.array([np.concatenate([v.ravel() for v in r.observation.values()]) for r in rows])


@each_scenario
def test_the_same_seed_gives_the_same_episode_bit_for_bit(name):
    scene = scenario(name)
    first = episode(scene, 3)
    np.testing.assert_array_equal(episode(scene, 3), first)
    assert np.abs(first[-1] - first[0]).max() > 1e-3


@each_scenario
def test_another_seed_or_episode_starts_elsewhere_but_near(name):
    scene = scenario(name)
    environment = make_environment(scene, 3)
    starts = [environment.reset().observation["joint_positions"] for _ in range(2)]
    starts.append(make_environment(scene, 4).reset().observation["joint_positions"])
    for a, b in itertools.combinations(starts, 2):
        assert (a != b).all()
        # Six standard deviations of a difference, of 14 joints.
        assert np.abs(a - b).max() < 6.0 * np.sqrt(2.0) * scene.robots[0].start_deviation


def test_without_deviation_every_seed_starts_alike():
    exact = replace(BOX, robots=(replace(BOX.robots[0], start_deviation=0.0),))
    starts = [make_environment(exact, s).reset().observation["joint_positions"] for s in (3, 4)]
    np.testing.assert_array_equal(starts[0], starts[1])


# --- the same plant as the closed loop's ---


def soon(scene):
    """The scenario with hands that start near and grip at once."""
    phases = (
        Phase("touch", 0.1, tilt=0.0, gap=0.0, grip=0.0),
        Phase("grip", 0.2, tilt=0.0, gap=0.0, grip=1.0),
        Phase("hold", 0.1, tilt=0.0, gap=0.0, grip=1.0),
    )
    return replace(scene, standoff=0.002, phases=phases)


@cache
def looped(name):
    """The first rows of a closed loop with seed 5."""
    scene = soon(scenario(name))
    loop = closed_loop(scene, scene.control, seed=5)
    for _ in loop.run():
        if loop.steps >= LOOP_STEPS:
            break
    return loop.trace.rows(0, LOOP_STEPS)


def replay(name, torques):
    """Joint angles, object poses and contact forces when torques are applied step by step."""
    scene = soon(scenario(name))
    environment = make_environment(scene, 5, control_timestep=scene.physics.timestep)
    observation = environment.reset().observation
    q, poses, forces = [], [], []
    for tau in torques:
        q.append(observation["joint_positions"])
        poses.append(observation["object_pose"])
        observation = environment.step(tau).observation
        forces.append(observation["contact_forces"])
    return np.array(q), np.array(poses), np.array(forces)


@each_scenario
def test_replaying_a_closed_loop_s_torques_repeats_its_run_bit_for_bit(name):
    trace = looped(name)
    q, poses, forces = replay(name, trace.tau)
    np.testing.assert_array_equal(q, trace.q)
    np.testing.assert_array_equal(poses, np.hstack([trace.p_WO, trace.quat_WO]))
    np.testing.assert_array_equal(forces, trace.f_W)
    # The hands do press by then.
    hands = len(scenario(name).hands)
    assert np.linalg.norm(forces[-1, :hands, :3], axis=-1).min() > 0.1


@each_scenario
def test_a_replay_with_a_slightly_other_torque_is_caught(name):
    trace = looped(name)
    torques = trace.tau.copy()
    # In one step a nanonewton metre turns a light wrist by some 1e-13 rad.
    torques[10] += 1e-9
    assert not np.array_equal(replay(name, torques)[0], trace.q)


@each_scenario
def test_twist_is_that_before_the_last_physics_step_and_the_pose_that_after(name):
    trace, dt = looped(name), scenario(name).physics.timestep
    environment = make_environment(soon(scenario(name)), 5, control_timestep=dt)
    environment.reset()
    for row, tau in enumerate(trace.tau[:100]):
        observation = environment.step(tau).observation
        np.testing.assert_array_equal(observation["object_twist"], trace.twist_WO[row])
        np.testing.assert_array_equal(observation["object_pose"][:3], trace.p_WO[row + 1])
    assert np.abs(trace.twist_WO[100] - trace.twist_WO[99]).max() > 0.0
