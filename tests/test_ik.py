"""The planned path keeps the tips on the object and all limits, or says which one stops it."""

import itertools
from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assets import asset_path, velocity_limits
from scenarios import scenario, scenarios
from sim.ik import JointPath, PathError, plan_joints
from sim.path import Schedule, ScrewPath
from sim.scenario import Geom, Pose
from sim.scene import ObjectMotion, compose, tip_geom, tip_site

BOX = scenario("box-tilt")
# Inverse kinematics stops at a pose error of 1e-9; orientation counts at the lever of the tip.
ON_GRID = 1e-8
# A cubic spline through steps of h = 1 deg leaves h^4 / 384 times a fourth derivative of ~100 rad
# at 1 m, and more near its ends. Measured: 3e-8.
BETWEEN = 1e-6

each_scenario = pytest.mark.parametrize("name", scenarios())


def schedule_of(scene):
    return Schedule(scene.timing, ScrewPath(scene.path).end)


def plan(scene):
    return plan_joints(scene, ScrewPath(scene.path), schedule_of(scene))


@cache
def planned(name):
    return plan(scenario(name))


@cache
def posed_model(name):
    return compose(scenario(name), ObjectMotion.POSED).compile()


def posed(scene, model, q, tilt):
    """MuJoCo's data with the robot at angles q, (l,), and the object at a tilt [rad]."""
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[model.actuator_trnid[:, 0]]] = q
    R_WO, p_WO = ScrewPath(scene.path).pose(tilt)
    mocap = model.body(scene.object.name).mocapid[0]
    data.mocap_pos[mocap] = p_WO
    data.mocap_quat[mocap] = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
    mujoco.mj_kinematics(model, data)
    return data


def tip_errors(name, path, tilts):
    """Largest error of the tips' centres [m] and of their axes [-] at tilts [rad]."""
    scene, model = scenario(name), posed_model(name)
    positions, axes = [], []
    for tilt in tilts:
        data = posed(scene, model, path(tilt)[0], tilt)
        thing = data.body(scene.object.name)
        R_WO = thing.xmat.reshape(3, 3)
        for hand in scene.hands:
            normal, tangent = R_WO @ hand.normal_O, R_WO @ hand.tangent_O
            radius = model.geom(tip_geom(hand)).size[0]
            tip = data.site(tip_site(hand))
            expected = thing.xpos + R_WO @ hand.p_OC_O - radius * normal
            positions.append(tip.xpos - expected)
            tip_axes = tip.xmat.reshape(3, 3)
            axes.append(tip_axes - np.column_stack([tangent, np.cross(normal, tangent), normal]))
    return float(np.abs(positions).max()), float(np.abs(axes).max())


def between(path):
    """Tilts between the grid's, ten in every step."""
    fractions = (np.arange(10) + 0.5) / 10
    return (path.tilts[:-1, None] + np.diff(path.tilts)[:, None] * fractions).ravel()


def tampered(path, change):
    """The path with every joint a little off [rad or m]."""
    return replace(path, q=path.q + change)


# --- the path is followed ---


@each_scenario
def test_tips_touch_the_object_at_every_grid_tilt(name):
    path = planned(name)
    position, axis = tip_errors(name, path, path.tilts)
    assert position < ON_GRID
    assert axis < ON_GRID
    # A ten-millionth of a radian is caught.
    position, axis = tip_errors(name, tampered(path, 1e-7), path.tilts)
    assert position > ON_GRID
    assert axis > ON_GRID


@each_scenario
def test_tips_touch_the_object_between_grid_tilts(name):
    path = planned(name)
    position, axis = tip_errors(name, path, between(path))
    assert position < BETWEEN
    assert axis < BETWEEN
    # A path with a fifth of the grid is caught.
    coarse = JointPath(path.tilts[::5], path.q[::5], path.clearance)
    assert tip_errors(name, coarse, between(path)[:200])[0] > BETWEEN


@each_scenario
def test_grid_spans_the_path_in_steps_of_a_degree_at_most(name):
    path, end = planned(name), np.radians(scenario(name).path.angle_deg)
    assert path.tilts[0] == 0.0
    assert path.tilts[-1] == pytest.approx(end, abs=1e-15)
    assert np.degrees(np.diff(path.tilts)).max() < 1.0 + 1e-9


@each_scenario
def test_slope_is_the_derivative_by_the_tilt(name):
    path, h = planned(name), 1e-5
    tilts = between(path)
    slope = (path(tilts + h)[0] - path(tilts - h)[0]) / (2.0 * h)
    # Rounding over 2 h is 1e-11, a third derivative of 100 times h^2 / 6 is 2e-9.
    np.testing.assert_allclose(path(tilts)[1], slope, rtol=0, atol=1e-8)
    assert np.abs(path(tilts + 1e-4)[1] - slope).max() > 1e-6


@each_scenario
def test_planning_twice_gives_the_same_path_bit_for_bit(name):
    np.testing.assert_array_equal(plan(scenario(name)).q, planned(name).q)


# --- limits are kept ---


@each_scenario
def test_joint_limits_are_kept_with_the_clearance_that_the_path_states(name):
    path, model = planned(name), posed_model(name)
    low, high = model.jnt_range[model.actuator_trnid[:, 0]].T
    clearance = np.minimum(path.q - low, high - path.q).min(axis=0)
    # The same subtraction.
    np.testing.assert_array_equal(path.clearance, clearance)
    assert (clearance > 0.0).all()
    q = path(between(path))[0]
    assert ((low < q) & (q < high)).all()
    # Any joint that is moved by its clearance and a bit is caught.
    beyond = tampered(path, np.where(path.q[0] > path.q[-1], 1, -1) * 10.0)
    assert (np.minimum(beyond.q - low, high - beyond.q).min(axis=0) < 0.0).all()


def test_box_path_stays_half_a_radian_from_every_joint_limit():
    assert planned("box-tilt").clearance.min() > 0.5


def fastest(scene, path, tilt_s):
    """Largest joint speed over its limit when the tilt takes a time [s]."""
    timing = replace(scene.timing, tilt_s=tilt_s)
    schedule = Schedule(timing, ScrewPath(scene.path).end)
    tilt, rate = schedule.tilt(np.linspace(0.0, timing.total_s, 5000))
    model = posed_model(scene.name)
    limits = velocity_limits(model)
    joints = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
    return np.max(np.abs(path(tilt)[1] * rate[:, None]) / [limits[j] for j in joints])


@each_scenario
def test_speed_limits_are_kept_over_the_schedule(name):
    scene, path = scenario(name), planned(name)
    utilisation = fastest(scene, path, scene.timing.tilt_s)
    assert utilisation < 1.0
    # So much faster, and the same check fails.
    assert fastest(scene, path, scene.timing.tilt_s * utilisation / 1.01) > 1.0


@each_scenario
def test_the_fastest_allowed_tilt_is_planned_and_a_faster_one_is_not(name):
    scene, path = scenario(name), planned(name)
    shortest = scene.timing.tilt_s * fastest(scene, path, scene.timing.tilt_s)
    # The path may bend within its redundancy, but a tenth of time is more than that gives.
    plan(replace(scene, timing=replace(scene.timing, tilt_s=1.1 * shortest)))
    with pytest.raises(PathError, match="speed limit"):
        plan(replace(scene, timing=replace(scene.timing, tilt_s=0.7 * shortest)))


def chain_of(model, geom):
    """The joints that carry a geom, from the base."""
    body, chain = model.geom_bodyid[geom], []
    while body:
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        chain = [*range(first, first + count), *chain]
        body = model.body_parentid[body]
    return chain


def joints_between(first, second):
    """Number of joints between two chains' ends, along the tree; infinite across branches."""
    longer, shorter = sorted((first, second), key=len, reverse=True)
    return len(longer) - len(shorter) if longer[: len(shorter)] == shorter else np.inf


def watched_pairs(scene, model, start):
    """Geoms that should keep clear of each other, from the tree of joints alone."""
    geoms = (*scene.object.geoms, *scene.environment)
    around = {g.name for g in geoms}
    open_to_arms = {g.name for g in geoms if not g.solid}
    touching = {frozenset((tip_geom(hand), hand.geom)) for hand in scene.hands}
    chains = [chain_of(model, g) for g in range(model.ngeom)]
    pairs = []
    for a, b in itertools.combinations(range(model.ngeom), 2):
        pair = {model.geom(a).name, model.geom(b).name}
        if not (chains[a] or chains[b]) or pair in touching or pair <= around:
            continue
        if pair & open_to_arms:
            continue
        if not pair & around:
            near = joints_between(chains[a], chains[b]) <= 3
            if near or mujoco.mj_geomDistance(model, start, a, b, 0.05, None) <= 0.0:
                continue
        pairs.append((a, b))
    return pairs


def nearest(scene, model, path, tilts):
    """Smallest distance of watched geoms over tilts, up to 50 mm [m], and between which."""
    posture = [scene.robot.posture[model.joint(int(j)).name] for j in model.actuator_trnid[:, 0]]
    pairs = watched_pairs(scene, model, posed(scene, model, posture, 0.0))
    assert len(pairs) > 100
    best = np.inf, ""
    for tilt in tilts:
        data = posed(scene, model, path(tilt)[0], tilt)
        for a, b in pairs:
            distance = mujoco.mj_geomDistance(model, data, a, b, 0.05, None)
            best = min(best, (distance, f"{model.geom(a).name} {model.geom(b).name}"))
    return best


@each_scenario
def test_links_keep_clear_of_each_other_and_of_the_scene(name):
    path = planned(name)
    # Half of the grid; the arms move by less than 2 cm in a step. The limit is 5 mm, of which
    # linearisation within a step may cost a little.
    distance, which = nearest(scenario(name), posed_model(name), path, path.tilts[::2])
    assert distance > 4.9e-3, which


def test_a_post_in_the_way_of_the_planned_arm_is_caught_by_its_distance():
    path = planned("box-tilt")
    scene = replace(BOX, environment=(*BOX.environment, POST))
    model = compose(scene, ObjectMotion.POSED).compile()
    distance, which = nearest(scene, model, path, path.tilts[10:40:10])
    assert distance < 0.0
    assert "post" in which


# --- what stops the arms is named ---

POST = Geom("post", "sphere", (0.05,), Pose((0.6, 0.35, 0.1)))


def moved(scene, dx):
    """The scenario with object, path and environment further from the robot [m]."""

    def shifted(pose):
        return replace(pose, position=(pose.position[0] + dx, *pose.position[1:]))

    x, *yz = scene.path.point_W
    return replace(
        scene,
        environment=tuple(replace(g, pose=shifted(g.pose)) for g in scene.environment),
        path=replace(scene.path, start=shifted(scene.path.start), point_W=(x + dx, *yz)),
    )


def assert_stopped(scene, reason, earliest_deg, latest_deg):
    """The path is refused for one reason, between two tilts [deg]; returns the message."""
    with pytest.raises(PathError) as error:
        plan(scene)
    found = error.value
    assert earliest_deg <= found.tilt_deg <= latest_deg
    assert any(reason in r for r in found.reasons), found.reasons
    message = str(found)
    assert f"only up to a tilt of {found.tilt_deg:.1f} deg" in message
    assert all(r in message for r in found.reasons)
    return found.reasons


def test_box_out_of_reach_is_refused_at_the_start():
    plan(moved(BOX, 0.0))
    reasons = assert_stopped(moved(BOX, 0.25), "out of reach of the arms", 0.0, 0.0)
    assert len(reasons) == 1


def test_tilt_in_half_a_second_is_refused_at_the_speed_of_the_elbows():
    fast = replace(BOX, timing=replace(BOX.timing, tilt_s=0.5))
    # Baxter's arms are symmetric, so that both stop; s, e: 1.5 rad/s, w: 4 rad/s.
    reasons = assert_stopped(fast, "left_e1 at its speed limit 1.5 rad/s", 0.0, 5.0)
    assert "right_e1 at its speed limit 1.5 rad/s" in reasons
    assert not [r for r in reasons if "_w" in r]


def test_an_obstacle_in_the_arm_s_way_is_named_with_the_link():
    blocked = replace(BOX, environment=(*BOX.environment, POST))
    reasons = assert_stopped(blocked, "post within 5 mm of left_", 5.0, 15.0)
    assert not [r for r in reasons if "right" in r]


def test_a_contact_point_that_is_no_number_is_never_reached():
    nowhere = replace(BOX.hands[0], p_OC_O=(np.nan, 0.1, 0.0))
    with pytest.raises(PathError, match=r"tilt of 0\.0 deg"):
        plan(replace(BOX, hands=(nowhere, BOX.hands[1])))


def with_robot(tmp_path, monkeypatch, edit):
    """Makes the scene's robot an edited copy of Baxter; the scenario's data cannot do that."""
    spec = mujoco.MjSpec.from_file(str(asset_path("baxter.xml")))
    edit(spec)
    spec.compile()
    copy = tmp_path / "baxter.xml"
    copy.write_text(spec.to_xml())
    monkeypatch.setattr(
        "sim.scene.asset_path", lambda name: copy if name == "baxter.xml" else asset_path(name)
    )


@pytest.mark.parametrize(
    ("side", "low", "high", "reason"),
    [
        ("left", -0.9, -0.5, "left_w2 at its upper limit -0.500 rad"),
        ("right", 0.5, 0.9, "right_w2 at its lower limit 0.500 rad"),
    ],
)
def test_a_joint_range_in_the_way_is_named(tmp_path, monkeypatch, side, low, high, reason):
    def narrow(spec):
        spec.joint(f"{side}_w2").range = [low, high]

    with_robot(tmp_path, monkeypatch, narrow)
    # The unrestricted path leaves that range soon; the arm's redundancy makes up for it till late.
    reasons = assert_stopped(BOX, reason, 45.0, 89.0)
    assert all(r.startswith(side) for r in reasons)


def test_an_unedited_copy_of_the_robot_is_planned_alike(tmp_path, monkeypatch):
    with_robot(tmp_path, monkeypatch, lambda spec: None)
    # The copy is printed with six digits; the largest joint angle is 2 rad.
    np.testing.assert_allclose(plan(BOX).q, planned("box-tilt").q, rtol=0, atol=1e-4)
