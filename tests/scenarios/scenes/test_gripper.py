"""The gripper and the hollow cylinder are what they claim to be, and how far they can go."""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh

from fulcrum.assets import asset_path, velocity_limits
from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.object import GRAVITY
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.scene import compose, tip_geom, tip_site
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.joint_path import PathError
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.recording.scenery import Scenery
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.phases import stretched
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.synthesis import InfeasibleError, Synthesizer
from fulcrum.synthesis.arrays import Array

SCENARIO = scenario("cylinder-tilt")
OUTER, INNER, LENGTH = 0.18, 0.15, 0.5  # [m]: Table I of the paper
FINGERS = ["outer_finger", "inner_finger"]
SLIDES = ["slide_x", "slide_y", "slide_z"]
HINGES = ["wrist_pitch", "wrist_yaw", "wrist_roll"]
# The tilt up to which equilibrium is asked for, beyond all that friction allows [deg].
FAR = 86.0
STEP_DEG = 0.02


@pytest.fixture(scope="module")
def gripper() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(asset_path("gripper.xml")))


@pytest.fixture(scope="module")
def scene() -> mujoco.MjModel:
    return compose(SCENARIO).compile()


def to(scenario: Scenario, angle_deg: float) -> Scenario:
    """The scenario with another angle at the end of its path."""
    return replace(scenario, path=replace(scenario.path, angle_deg=angle_deg))


def tilting(scenario: Scenario) -> Array:
    """Joint angles over the tilting phase, (k, l)."""
    names = [phase.name for phase in scenario.phases]
    return plan_joints(scenario).q[names.index("tilt")]


def posed(model: mujoco.MjModel, q: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, value in q.items():
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)
    return data


def test_the_stage_has_six_joints_and_each_finger_one_of_30_newtons(gripper):
    names = [gripper.joint(i).name for i in range(gripper.njnt)]
    assert names == SLIDES + HINGES + FINGERS
    slides = [n for n in names if gripper.joint(n).type[0] == mujoco.mjtJoint.mjJNT_SLIDE]
    assert slides == SLIDES + FINGERS
    assert [gripper.actuator(i).name for i in range(gripper.nu)] == names
    for name in names:
        limit = gripper.actuator(name).ctrlrange
        np.testing.assert_array_equal(limit, gripper.jnt_actfrcrange[gripper.joint(name).id])
        assert limit[1] == -limit[0]
        assert (limit[1] == 30.0) if name in FINGERS else limit[1] >= 30.0
    assert {hand.f_n_max for hand in SCENARIO.hands} == {30.0}


def test_every_joint_has_a_range_and_a_speed_limit(gripper):
    speeds = velocity_limits(gripper)
    assert set(speeds) == set(SLIDES + HINGES + FINGERS)
    assert {speeds[name] for name in SLIDES} == {1.0}
    assert {speeds[name] for name in FINGERS} == {0.2}
    assert gripper.jnt_limited.all()


def test_the_stage_carries_7_kg_and_each_finger_weighs_120_g_with_its_tip(gripper, scene):
    # Sums of the masses in gripper.xml (and of the tips) in double precision.
    assert gripper.body("bridge").subtreemass[0] == pytest.approx(6.9, abs=1e-9)
    assert gripper.body("palm").subtreemass[0] == pytest.approx(0.8, abs=1e-9)
    for finger in FINGERS:
        assert gripper.body(finger).mass[0] == pytest.approx(0.1, abs=1e-9)
        assert scene.body(finger).subtreemass[0] == pytest.approx(0.12, abs=1e-9)


def asymmetry(model: mujoco.MjModel, inner: float) -> float:
    """How far [m] inner finger, tip and all are from mirror images, outer finger at 0.02 m."""
    data = posed(model, {"outer_finger": 0.02, "inner_finger": inner})
    wrist = data.body("palm").xpos
    above = data.site("outer_tip_center").xpos - wrist
    below = data.site("inner_tip_center").xpos - wrist
    centers = [data.body(name).xipos - wrist for name in FINGERS]
    mirror = np.array([1.0, 1.0, -1.0])
    return max(
        float(np.abs(above - mirror * below).max()),
        float(np.abs(centers[0] - mirror * centers[1]).max()),
        abs(float(data.body("palm").subtree_com[2] - wrist[2])),
    )


def test_the_fingers_are_mirror_images(scene):
    # Rounding of positions of about 1 m.
    assert asymmetry(scene, 0.02) < 1e-12
    assert asymmetry(scene, 0.021) > 0.9e-3


def test_the_wrist_axes_meet_20_cm_behind_the_tips(gripper, scene):
    data = posed(scene, {"wrist_pitch": 0.3, "wrist_yaw": -0.2, "wrist_roll": 0.5})
    anchors = np.array([data.joint(name).xanchor for name in HINGES])
    np.testing.assert_allclose(anchors, anchors[[0, 0, 0]], atol=1e-12)  # rounding
    tips = [data.site(f"{side}_tip_center").xpos for side in ("outer", "inner")]
    forward = data.body("palm").xmat.reshape(3, 3) @ [-1.0, 0.0, 0.0]
    for tip in tips:
        assert (tip - anchors[0]) @ forward == pytest.approx(0.2, abs=1e-12)


def test_pinocchio_and_mujoco_agree_on_slides_and_hinges(scene):
    robot = RobotModel(SCENARIO)
    assert list(robot.joints) == SLIDES + HINGES + FINGERS
    columns = [int(scene.joint(name).dofadr[0]) for name in robot.joints]
    rng = np.random.default_rng(0)
    for q in rng.uniform(robot.q_min, robot.q_max, (10, len(robot.joints))):
        data = posed(scene, dict(zip(robot.joints, q, strict=True)))
        state = robot.at(q)
        mass = np.zeros((scene.nv, scene.nv))
        mujoco.mj_fullM(scene, data, mass)
        # Double precision on numbers up to 1e2.
        np.testing.assert_allclose(state.tau_g, data.qfrc_bias[columns], atol=1e-12)
        np.testing.assert_allclose(state.mass_matrix(), mass[np.ix_(columns, columns)], atol=1e-12)
        p_WC = np.array([data.site(tip_site(hand)).xpos for hand in SCENARIO.hands])
        J_C = state.contact_jacobians(p_WC, np.array([np.eye(3)] * 2))
        for hand, J in zip(SCENARIO.hands, J_C, strict=True):
            expected = np.zeros((6, scene.nv))
            site = scene.site(tip_site(hand)).id
            mujoco.mj_jacSite(scene, data, expected[:3], expected[3:], site)
            np.testing.assert_allclose(J, expected[:, columns], atol=1e-12)


def test_the_fingers_share_the_stage_but_not_each_other():
    robot = RobotModel(SCENARIO)
    state = robot.at(np.array([SCENARIO.posture[name] for name in robot.joints]))
    J_C = state.contact_jacobians(np.zeros((2, 3)), np.array([np.eye(3)] * 2))
    np.testing.assert_array_equal(J_C[0, 3:, :6], J_C[1, 3:, :6])
    moves = np.abs(J_C).max(axis=1) > 1e-9
    np.testing.assert_array_equal(moves[:, 6:], [[True, False], [False, True]])


def annulus_inertia(inner: float) -> np.ndarray:
    """Principal moments by trimesh of the tube of the cylinder's mass, along the axis first."""
    # 2048 facets leave out 2e-6 of the cross-section.
    tube = trimesh.creation.annulus(inner, OUTER, LENGTH, sections=2048)
    tube.density = SCENARIO.object.mass / tube.volume
    across, _, along = np.diag(tube.moment_inertia)
    return np.array([along, across, across])


def test_the_cylinder_has_the_weight_and_inertia_of_its_hollow_shape():
    thing = SCENARIO.object
    assert thing.mass * GRAVITY == pytest.approx(30.0, rel=1e-12)  # rounding
    np.testing.assert_allclose(thing.inertia, annulus_inertia(INNER), rtol=1e-5)
    # A fuller cylinder is caught.
    assert np.abs(annulus_inertia(0.8 * INNER) / thing.inertia - 1.0).max() > 0.05


def test_the_wall_fills_the_gap_between_the_tips(scene):
    start = tilting(SCENARIO)[0]
    names = RobotModel(SCENARIO).joints
    data = posed(scene, dict(zip(names, start, strict=True)))

    def gap(first: str, second: str) -> float:
        ids = scene.geom(first).id, scene.geom(second).id
        return mujoco.mj_geomDistance(scene, data, *ids, 1.0, None)

    outer, inner = (tip_geom(hand) for hand in SCENARIO.hands)
    # Inverse kinematics stops at a pose error of 1e-9.
    assert gap(outer, inner) == pytest.approx(0.03, abs=1e-8)
    assert 2 * scene.geom("wall").size[2] == pytest.approx(0.03, abs=1e-12)
    for tip in (outer, inner):
        assert gap(tip, "wall") == pytest.approx(0.0, abs=1e-8)


def test_the_wall_pieces_lie_between_bore_and_floor(scene):
    data = mujoco.MjData(scene)
    mujoco.mj_kinematics(scene, data)
    pieces = [g.name for g in SCENARIO.object.geoms if g.kind == "box"]
    assert len(pieces) == 32
    for name in pieces:
        geom, size = data.geom(name), scene.geom(name).size
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        corners = geom.xpos + (signs * size) @ geom.xmat.reshape(3, 3).T
        assert corners[:, 2].min() > -1e-12  # nothing pokes through the floor
        radii = np.linalg.norm((corners - data.body("cylinder").xpos)[:, 1:], axis=1)
        assert radii.min() >= INNER
        assert radii.max() < OUTER + 0.7e-3  # flat pieces stand out at their corners


def test_the_full_cylinder_that_rolls_on_the_floor_is_neither_obstacle_nor_drawn(scene):
    robot = RobotModel(SCENARIO)
    shown = {scene.geom(g).name for g in Scenery(SCENARIO, robot.joints)._primitives()}
    hidden = {g.name for g in SCENARIO.object.geoms} - shown
    assert hidden == {"rim"} == {g.name for g in SCENARIO.object.geoms if not g.solid}
    full = [replace(g, solid=True) for g in SCENARIO.object.geoms]
    blocked = replace(SCENARIO, object=replace(SCENARIO.object, geoms=tuple(full)))
    with pytest.raises(PathError, match="of rim"):
        plan_joints(to(blocked, 10.0))


def test_the_fingers_keep_still_while_the_stage_moves():
    # Still joints take the share 1e-8 / 1e-2 of the 0.8 m that the stage goes.
    assert np.ptp(tilting(to(SCENARIO, FAR))[:, 6:], axis=0).max() < 1e-5
    restless = replace(SCENARIO, robots=(replace(SCENARIO.robots[0], still=()),))
    assert np.ptp(tilting(to(restless, 20.0))[:, 6:], axis=0).max() > 1e-2


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            lambda s: replace(s, robots=(replace(s.robots[0], base=Pose((0.6, 0.0, 0.0))),)),
            "slide_x at its lower limit -0.500 m",
        ),
        (
            lambda s: replace(s, phases=stretched(s.phases, 0.5)),
            "at its speed limit 1 m/s",
        ),
        (
            lambda s: replace(s, phases=stretched(s.phases, 0.05)),
            "wrist_pitch at its speed limit 3 rad/s",
        ),
    ],
)
def test_limits_that_stop_the_stage_are_named_with_their_units(
    change: Callable[[Scenario], Scenario], reason: str
):
    with pytest.raises(PathError, match=reason):
        plan_joints(change(SCENARIO))


def reach(scenario: Scenario, control: Control) -> float:
    """The tilt [deg] up to which there is equilibrium with the gripper's motors."""
    problems, synthesizer = PathProblems(to(scenario, FAR), control), Synthesizer()

    def feasible(tilt_deg: float) -> bool:
        try:
            synthesizer.solve(problems.problem(tilt_deg))
        except InfeasibleError:
            return False
        return True

    coarse = np.arange(0.0, FAR, 1.0)
    first = next(i for i, tilt in enumerate(coarse) if not feasible(float(tilt)))
    low, high = float(coarse[first]) - 1.0, float(coarse[first])
    while high - low > STEP_DEG:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if feasible(middle) else (low, middle)
    return low


@pytest.mark.parametrize(
    ("control", "expected_deg"),
    [
        (Control(friction_factor=1.0, preload=0.0), 84.43),
        (SCENARIO.control, 78.12),
        (replace(SCENARIO.control, preload=0.0), 78.12),
        (Control(friction_factor=0.8, preload=10.0), 76.25),
    ],
)
def test_friction_sets_how_far_the_cylinder_can_go(control, expected_deg):
    assert reach(SCENARIO, control) == pytest.approx(expected_deg, abs=2 * STEP_DEG)


def test_the_scenario_stays_within_reach_and_weaker_fingers_would_not():
    end = SCENARIO.path.angle_deg
    assert 75.0 <= end < reach(SCENARIO, SCENARIO.control) - 1.0
    hands = tuple(replace(hand, f_n_max=24.0) for hand in SCENARIO.hands)
    assert reach(replace(SCENARIO, hands=hands), SCENARIO.control) < end
