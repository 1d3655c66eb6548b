"""Scenarios that contradict themselves, or what is shipped, are refused by name."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.assets import asset_path
from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.model.robot_model import pinocchio_model
from fulcrum.sim.model.scene import compose
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.run.environment import make_environment
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.scenario.contacts import Friction
from fulcrum.sim.scenario.material import ContactMaterial
from fulcrum.sim.scenario.phases import stretched
from fulcrum.sim.scenario.physics import Physics, Tolerances
from fulcrum.synthesis import InvalidInputError

BOX = scenario("box-tilt")
NO_NUMBER_ABOVE_0 = (0.0, -1.0, math.nan, math.inf)


def with_hand(**changes):
    return replace(BOX, hands=(replace(BOX.hands[0], **changes), BOX.hands[1]))


def with_robot(**changes):
    return replace(BOX, robots=(replace(BOX.robots[0], **changes),))


def with_posture(**angles):
    return with_robot(posture={**BOX.robots[0].posture, **angles})


def with_support(**changes):
    return replace(BOX, supports=(replace(BOX.supports[0], **changes), BOX.supports[1]))


def assert_refused(make, field, given, valid):
    with pytest.raises(InvalidInputError) as error:
        compose(make())
    assert error.value.field == field
    message = str(error.value)
    assert message.startswith(f"{field}: got {given}; valid is ")
    assert valid in message.partition("valid is")[2]


def test_the_scenario_itself_is_composed():
    assert compose(with_hand()).compile().nu == len(BOX.posture)


def test_a_joint_that_the_robot_lacks_is_refused_by_name():
    assert_refused(lambda: with_posture(left_s9=0.1), "robot.posture", "left_s9", "left_s0")


def test_a_mount_that_the_robot_lacks_is_refused_by_name():
    assert_refused(
        lambda: with_hand(mount="left_foot"), "left.mount", "left_foot", "left_hand_link"
    )


@pytest.mark.parametrize("field", ["torque_limits", "speed_limits"])
def test_a_limit_of_a_joint_that_the_robot_lacks_is_refused_by_name(field):
    assert_refused(
        lambda: with_robot(**{field: {"left_s9": 1.0}}), f"robot.{field}", "left_s9", "left_s0"
    )
    compose(with_robot(**{field: {"left_s0": 1.0}}))


@pytest.mark.parametrize("limit", NO_NUMBER_ABOVE_0)
def test_a_limit_that_is_no_positive_number_is_refused_by_name(limit):
    assert_refused(
        lambda: with_robot(torque_limits={"left_s0": limit}),
        "robot.torque_limits.left_s0",
        limit,
        "> 0",
    )


def test_a_joint_that_is_to_keep_still_but_is_not_driven_is_refused_by_name():
    assert_refused(lambda: with_robot(still=("left_s9",)), "robot.still", "left_s9", "left_s0")


def test_two_robots_with_the_same_prefix_are_refused():
    (robot,) = BOX.robots
    for prefix in ("", "blue_"):
        twins = (replace(robot, prefix=prefix),) * 2
        assert_refused(lambda t=twins: replace(BOX, robots=t), "robot.prefix", repr(prefix), "no ")


def test_a_scene_without_a_robot_is_refused():
    with pytest.raises(InvalidInputError, match=r"^robots: got \(\); valid is at least one robot"):
        replace(BOX, robots=())


def test_a_robot_model_that_neither_ships_nor_is_a_file_is_refused_by_name():
    assert_refused(lambda: with_robot(model="atlas"), "robot.model", "'atlas'", "baxter, gripper")
    with pytest.raises(InvalidInputError, match=r"^blue_robot\.model: got 'atlas'"):
        compose(with_robot(model="atlas", prefix="blue_"))


def test_a_robot_file_that_mujoco_does_not_read_is_refused_by_name(tmp_path):
    broken = tmp_path / "robot.xml"
    broken.write_text("<mujoco><bodi/></mujoco>")
    with pytest.raises(InvalidInputError, match=r"^robot\.model: got .*a file that MuJoCo reads"):
        compose(with_robot(model=str(broken)))


def test_a_geom_kind_that_mujoco_lacks_is_refused_by_name():
    pyramid = Geom("pyramid", "pyramid", (0.1, 0.1))
    environment = (*BOX.environment, pyramid)
    assert_refused(
        lambda: replace(BOX, environment=environment), "pyramid.kind", "pyramid", "sphere, capsule"
    )


def test_a_contact_on_a_geom_that_the_object_lacks_is_refused_by_name():
    assert_refused(lambda: with_hand(geom="lid"), "left.geom", "lid", "one of box")
    assert_refused(lambda: with_support(geom="lid"), "edge_left.geom", "lid", "one of box")


def test_a_support_on_a_surface_that_is_not_there_is_refused_by_name():
    assert_refused(lambda: with_support(surface="floor"), "edge_left.surface", "floor", "table")


def test_two_frictions_between_the_same_geoms_are_refused():
    # One pair of geoms has one friction in MuJoCo; the second to ask is named.
    assert_refused(
        lambda: with_support(friction=Friction(mu=0.2)),
        "edge_right.friction",
        "Friction(mu=0.25, e_n=None)",
        "Friction(mu=0.2, e_n=None), as at other contacts of box on table",
    )


def test_a_hand_model_that_is_not_shipped_is_refused_by_name():
    with pytest.raises(InvalidInputError, match=r"'claw.xml'.*palm_pad"):
        compose(with_hand(model="claw.xml"))


# --- what a dataclass refuses when it is made ---


@pytest.mark.parametrize("value", NO_NUMBER_ABOVE_0)
@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("box.mass", lambda v: replace(BOX.object, mass=v)),
        ("box.inertia", lambda v: replace(BOX.object, inertia=(0.1, v, 0.1))),
        ("friction.mu", lambda v: Friction(mu=v)),
        ("friction.e_n", lambda v: Friction(mu=0.1, e_n=v)),
        ("physics.timestep", lambda v: Physics(timestep=v)),
        ("physics.impratio", lambda v: Physics(impratio=v)),
        ("material.stiffness", lambda v: ContactMaterial(v, 0.002)),
        ("material.damping_s", lambda v: ContactMaterial(4e4, v)),
    ],
)
def test_what_must_be_a_finite_number_above_0_is_refused_by_name(field, make, value):
    make(0.5)
    with pytest.raises(InvalidInputError, match=rf"^{field}: got {value}; valid is a finite"):
        make(value)


@pytest.mark.parametrize("value", [-1, 2.0, True])
def test_noslip_iterations_that_are_no_count_are_refused_by_name(value):
    Physics(noslip_iterations=0)
    with pytest.raises(
        InvalidInputError, match=rf"^physics\.noslip_iterations: got {value}; valid"
    ):
        Physics(noslip_iterations=value)


HAND, SUPPORT = BOX.hands[0], BOX.supports[0]


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, math.nan, 1.0)])
@pytest.mark.parametrize(
    ("contact", "field"),
    [(HAND, "normal_O"), (HAND, "tangent_O"), (SUPPORT, "normal_W"), (SUPPORT, "tangent_W")],
)
def test_a_direction_that_is_no_unit_vector_is_refused_by_name(contact, field, vector):
    with pytest.raises(InvalidInputError) as error:
        replace(contact, **{field: vector})
    assert error.value.field == f"{contact.name}.{field}"
    assert "length 1" in str(error.value)


@pytest.mark.parametrize(
    ("contact", "field"), [(HAND, "tangent_O"), (SUPPORT, "tangent_W")], ids=["hand", "support"]
)
def test_a_tangent_that_is_not_perpendicular_to_its_normal_is_refused_by_name(contact, field):
    t, n = getattr(contact, field), getattr(contact, field.replace("tangent", "normal"))
    for angle, refused in ((1e-5, True), (1.0, True), (1e-7, False)):
        oblique = tuple(
            math.cos(angle) * a + math.sin(angle) * b for a, b in zip(t, n, strict=True)
        )
        if not refused:
            replace(contact, **{field: oblique})
            continue
        with pytest.raises(InvalidInputError, match=rf"^{contact.name}\.{field}: .* perpendicular"):
            replace(contact, **{field: oblique})


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_a_largest_force_that_lets_no_hand_press_is_refused_by_name(value):
    replace(HAND, f_n_max=math.inf)
    with pytest.raises(InvalidInputError, match=rf"^left\.f_n_max: got {value}; valid"):
        replace(HAND, f_n_max=value)


def test_two_contacts_of_one_name_are_refused():
    assert_refused(lambda: with_hand(name="right"), "contact names", "right", "no other")
    assert_refused(lambda: with_support(name="left"), "contact names", "left", "no other")


@pytest.mark.parametrize("value", [-1e-3, math.nan, math.inf])
def test_a_senseless_standoff_is_refused_by_name(value):
    assert_refused(lambda: replace(BOX, standoff=value), "standoff", value, ">= 0")


def test_a_scenario_without_phases_is_refused():
    assert_refused(lambda: replace(BOX, phases=()), "phases", "()", "at least one")


# --- what the assets do not fit ---


@pytest.mark.parametrize("angle", [1.71, -1.71])
def test_a_start_angle_outside_its_joint_s_range_is_refused_by_name(angle):
    assert_refused(
        lambda: with_posture(left_s0=angle), "robot.posture.left_s0", angle, "[-1.70168, 1.70168]"
    )
    compose(with_posture(left_s0=angle / 1.01))


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_a_start_angle_that_is_no_number_is_refused_by_name(angle):
    with pytest.raises(InvalidInputError, match=rf"^robot\.posture\.left_s0: got {angle}; valid"):
        with_posture(left_s0=angle)


@pytest.mark.parametrize(
    ("right", "wrong", "missing"),
    [
        ('body name="pad"', 'body name="palm"', "body pad"),
        ('geom name="tip"', 'geom name="ball"', "geom tip"),
        ('site name="tip_center"', 'site name="centre"', "site tip_center"),
    ],
)
def test_a_hand_without_one_of_its_parts_is_refused_by_name(tmp_path, right, wrong, missing):
    pad, copy = asset_path("palm_pad.xml").read_text(), tmp_path / "palm_pad.xml"
    copy.write_text(pad)
    compose(with_hand(model=str(copy)))
    assert right in pad
    copy.write_text(pad.replace(right, wrong))
    assert_refused(lambda: with_hand(model=str(copy)), "left.model", str(copy), missing)


def test_a_ball_joint_is_refused_by_name():
    mjcf = (
        '<mujoco><worldbody><body><joint name="{0}" type="{0}"/><geom size="1"/></body>'
        "</worldbody></mujoco>"
    )
    for kind in ("hinge", "slide"):
        pinocchio_model(mujoco.MjModel.from_xml_string(mjcf.format(kind)))
    with pytest.raises(InvalidInputError, match=r"^joint ball: got a ball joint; valid is a hinge"):
        pinocchio_model(mujoco.MjModel.from_xml_string(mjcf.format("ball")))


@pytest.mark.parametrize("field", ["final_deg", "slip_mm", "utilisation", "force_error"])
@pytest.mark.parametrize("value", [float("nan"), 0.0, -1.0])
def test_a_tolerance_that_could_not_fail_or_pass_is_refused(field, value):
    with pytest.raises(InvalidInputError, match=f"tolerances.{field}: got"):
        Tolerances(**{field: value})


def test_a_shape_that_is_no_shape_is_refused():
    Geom("ball", "sphere", (0.1,))
    for bad in ({"size": (float("nan"),)}, {"size": (-1.0,)}, {"rgba": (0.0, 0.0, 0.0, np.inf)}):
        with pytest.raises(InvalidInputError, match="ball"):
            Geom("ball", "sphere", **({"size": (0.1,)} | bad))


def test_two_stretches_with_full_grip_are_refused():
    again = (*BOX.phases, *BOX.phases[1:])
    with pytest.raises(InvalidInputError, match=r"phases: .*one stretch with full grip"):
        Schedule(replace(BOX, phases=again))
    Schedule(BOX)


def test_a_run_is_never_written_over_another(tmp_path):
    (tmp_path / "run.rrd").write_text("somebody's")
    with pytest.raises(InvalidInputError, match=r"out: .*new or empty folder"):
        execute(Request(BOX, "margin", BOX.control, out=tmp_path))
    assert (tmp_path / "run.rrd").read_text() == "somebody's"


def test_a_run_off_the_main_thread_runs():
    short = replace(BOX, phases=stretched(BOX.phases, 5.0))
    with ThreadPoolExecutor(1) as pool:
        report = pool.submit(execute, Request(short, "margin", short.control)).result().report
    # It ran, and was judged.
    assert report.tilt.final_deg == pytest.approx(90.0, abs=0.2)


def test_time_between_actions_must_be_whole_steps():
    with pytest.raises(InvalidInputError, match=r"control_timestep: .*multiple"):
        make_environment(BOX, control_timestep=0.0015)


def test_a_new_episode_knows_nothing_of_the_last_one_s_collisions():
    environment = make_environment(BOX, control_timestep=0.02)
    plant = environment.task._plant
    inwards = np.zeros(environment.action_spec().shape)
    inwards[plant.joints.index("right_s0")] = 50.0
    environment.reset()
    for _ in range(20):
        environment.step(inwards)
    assert ("right_upper_forearm_visual", "table") in plant.collisions
    environment.reset()
    assert not plant.collisions
