"""Several robots in one scene, their limits, and hands placed on them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.assets import velocity_limits
from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.scene import ObjectMotion, compose, hand_body
from fulcrum.sim.scenario.robot import Robot
from fulcrum.synthesis import InvalidInputError

BOX = scenario("box-tilt")


def twins(prefixes, **changes):
    """The cylinder's scene with a second gripper, a metre to the side."""
    scene = scenario("cylinder-tilt")
    (robot,) = scene.robots
    first, second = prefixes
    hands = tuple(replace(hand, mount=first + hand.mount) for hand in scene.hands)
    aside = replace(robot, prefix=second, base=Pose((0.0, 1.0, 0.0)), **changes)
    return replace(scene, hands=hands, robots=(replace(robot, prefix=first), aside))


@pytest.mark.parametrize("prefixes", [("", "b_"), ("b_", ""), ("a_", "b_")])
def test_two_robots_of_a_kind_stand_in_one_scene_under_their_prefixes(prefixes):
    scene = twins(prefixes, torque_limits={"slide_x": 50.0}, speed_limits={"slide_x": 0.5})
    model = compose(scene).compile()
    motors = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
    assert sorted(motors) == sorted(scene.posture)
    speeds = velocity_limits(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    first, second = prefixes
    for name in scene.robots[0].posture:
        ours, theirs = model.actuator(first + name), model.actuator(second + name)
        limit = ours.ctrlrange[1]
        lowered = name == "slide_x"
        assert theirs.ctrlrange.tolist() == ([-50.0, 50.0] if lowered else [-limit, limit])
        assert speeds[second + name] == (0.5 if lowered else speeds[first + name])
    apart = data.body(f"{second}palm").xpos - data.body(f"{first}palm").xpos
    # A chain of six frames at 1 m.
    np.testing.assert_allclose(apart, [0.0, 1.0, 0.0], rtol=0, atol=1e-14)
    assert np.abs(RobotModel(scene).start_deviation == 1e-4).all()


def test_a_prefix_that_gives_a_body_another_robot_s_name_is_refused(tmp_path):
    file = tmp_path / "arm.xml"
    text = '<mujoco><worldbody><body name="{}"><geom size="1"/></body></worldbody></mujoco>'
    file.write_text(text.format("b_bridge"))
    scene = twins(("a_", "b_"))
    compose(scene)
    other = Robot(str(file), posture={})
    for motion in ObjectMotion:
        with pytest.raises(
            InvalidInputError, match=r"^scene: got .*repeated name 'b_bridge' in body"
        ):
            compose(replace(scene, robots=(*scene.robots, other)), motion)
    file.write_text(text.format("bridge"))
    compose(replace(scene, robots=(*scene.robots, other)))


def test_limits_of_a_robot_are_never_raised_above_what_its_model_says():
    scene = twins(("", "b_"), torque_limits={"slide_x": 1e6}, speed_limits={"slide_x": 1e6})
    model = compose(scene).compile()
    assert model.actuator("b_slide_x").ctrlrange.tolist() == [-200.0, 200.0]
    assert velocity_limits(model)["b_slide_x"] == 1.0


def test_a_hand_is_placed_on_its_mount_as_the_scenario_says():
    pose = Pose((0.01, 0.02, 0.03), (0.8, 0.6, 0.0, 0.0))
    left, right = BOX.hands
    model = compose(replace(BOX, hands=(replace(left, mount_pose=pose), right))).compile()
    body = model.body(hand_body(left))
    np.testing.assert_array_equal(body.pos, pose.position)
    # MuJoCo normalises quaternions.
    np.testing.assert_allclose(body.quat, pose.quaternion, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(model.body(hand_body(right)).pos, 0.0)
