"""The planned path keeps joint, speed and collision limits, or names the one that stops it."""

import itertools
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fulcrum.assets import asset_path, velocity_limits
from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.scene import ObjectMotion, compose, tip_geom
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.joint_path import PathError
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.scenario.phases import stretched
from fulcrum.synthesis import InvalidInputError
from tests.helpers.postures import asked, between, on_grid, planned, posed, posed_model, tampered
from tests.helpers.runs import NAMES

BOX = scenario("box-tilt")
POST = Geom("post", "sphere", (0.05,), Pose((0.7, 0.3, 0.2)))

each_scenario = pytest.mark.parametrize("name", NAMES)


# --- limits are kept ---


@each_scenario
def test_joint_limits_are_kept_with_the_clearance_that_the_path_states(name):
    path, model = planned(name), posed_model(name)
    low, high = model.jnt_range[model.actuator_trnid[:, 0]].T
    every = np.concatenate(path.q)
    clearance = np.minimum(every - low, high - every).min(axis=0)
    # The same subtraction.
    np.testing.assert_array_equal(path.clearance, clearance)
    assert (clearance > 0.0).all()
    q = np.array([path.at(i, x)[0] for i, x in between(path)])
    assert ((low < q) & (q < high)).all()
    # Any joint that is moved by its clearance and a bit is caught.
    beyond = np.concatenate(tampered(path, 10.0).q)
    assert (np.minimum(beyond - low, high - beyond).min(axis=0) < 0.0).all()


def test_box_path_holds_far_from_every_joint_limit_and_comes_and_goes_not_much_nearer():
    path, model = planned("box-tilt"), posed_model("box-tilt")
    low, high = model.jnt_range[model.actuator_trnid[:, 0]].T
    holding = np.concatenate([path.q[i] for i in np.flatnonzero(path.schedule.held)])
    # Measured 0.563 rad, of an elbow at the end of the tilt.
    assert np.minimum(holding - low, high - holding).min() > 0.55
    # Measured 0.433, of a wrist where the hands come from.
    assert path.clearance.min() > 0.42


def fastest(scene, path):
    """Largest joint speed over its limit of each phase, (p,), by the path's slopes."""
    model, schedule = posed_model(scene.name), Schedule(scene)
    limits = velocity_limits(model)
    joints = [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]]
    limit = np.array([limits[j] for j in joints])
    shares = np.zeros(len(schedule.phases))
    for t in np.linspace(0.0, schedule.total_s, 5000):
        r = schedule.at(float(t))
        speed = np.abs(path.at(r.phase, r.progress)[1] * r.rate) / limit
        shares[r.phase] = max(shares[r.phase], speed.max())
    return shares


def with_durations(scene, share):
    """The scenario with all phases taking a share of their time."""
    phases = (replace(p, duration_s=share * p.duration_s) for p in scene.phases)
    return replace(scene, phases=tuple(phases))


@each_scenario
def test_speed_limits_are_kept_over_the_schedule(name):
    scene, path = scenario(name), planned(name)
    shares = fastest(scene, path)
    assert shares.max() < 1.0
    # So much faster, and the same check fails.
    assert fastest(with_durations(scene, shares.max() / 1.01), path).max() > 1.0


@each_scenario
def test_the_fastest_allowed_tilt_is_planned_and_a_faster_one_is_not(name):
    scene, path = scenario(name), planned(name)
    (tilt,) = [
        p for p, q in zip(scene.phases, stretched(scene.phases, 99.0), strict=True) if p != q
    ]
    shortest = tilt.duration_s * fastest(scene, path)[scene.phases.index(tilt)]
    # The path may bend within its redundancy, but a tenth of time is more than that gives.
    plan_joints(replace(scene, phases=stretched(scene.phases, 1.1 * shortest)))
    with pytest.raises(PathError, match="speed limit"):
        plan_joints(replace(scene, phases=stretched(scene.phases, 0.7 * shortest)))


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


def nearest(scene, model, path, where):
    """Smallest distance of watched geoms, up to 50 mm [m], and between which."""
    posture = [scene.posture[model.joint(int(j)).name] for j in model.actuator_trnid[:, 0]]
    pairs = watched_pairs(scene, model, posed(scene, model, posture, 0.0))
    assert len(pairs) > 100
    best = np.inf, ""
    for index, progress in where:
        tilt, _ = asked(path.schedule, index, progress)
        data = posed(scene, model, path.at(index, progress)[0], tilt)
        for a, b in pairs:
            distance = mujoco.mj_geomDistance(model, data, a, b, 0.05, None)
            best = min(best, (distance, f"{model.geom(a).name} {model.geom(b).name}"))
    return best


@each_scenario
def test_links_keep_clear_of_each_other_and_of_the_scene(name):
    path = planned(name)
    # Half of the grid; the arms move by less than 2 cm in a step. The limit is 5 mm, of which
    # linearisation within a step may cost a little.
    distance, which = nearest(scenario(name), posed_model(name), path, on_grid(path)[::2])
    assert distance > 4.9e-3, which


def test_a_post_in_the_way_of_the_planned_arm_is_caught_by_its_distance():
    path = planned("box-tilt")
    scene = replace(BOX, environment=(*BOX.environment, POST))
    model = compose(scene, ObjectMotion.POSED).compile()
    tilting = int(np.argmax(path.schedule.held))
    distance, which = nearest(scene, model, path, [(tilting, x / 90) for x in (10, 20, 30)])
    assert distance < 0.0
    assert "post" in which


# --- what stops the arms is named ---


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


def assert_stopped(scene, reason, earliest_deg, latest_deg, gap_mm=0):
    """The path is refused for one reason, between two tilts [deg]; returns all reasons."""
    with pytest.raises(PathError) as error:
        plan_joints(scene)
    found = error.value
    assert earliest_deg <= found.tilt_deg <= latest_deg
    assert any(reason in r for r in found.reasons), found.reasons
    message = str(found)
    assert f"cannot follow the path at a tilt of {found.tilt_deg:.1f} deg with the hands" in message
    assert f"hands {gap_mm} mm off their contacts" in message
    assert all(r in message for r in found.reasons)
    return found.reasons


def test_box_out_of_reach_is_refused_at_the_start():
    plan_joints(moved(BOX, 0.0))
    reasons = assert_stopped(moved(BOX, 0.25), "out of reach of the arms", 0.0, 0.0)
    assert len(reasons) == 1


def test_tilt_in_half_a_second_is_refused_at_the_speed_of_the_elbows():
    fast = replace(BOX, phases=stretched(BOX.phases, 0.5))
    # Baxter's arms are symmetric, so that both stop; s, e: 1.5 rad/s, w: 4 rad/s.
    reasons = assert_stopped(fast, "left_e1 at its speed limit 1.5 rad/s", 0.0, 5.0)
    assert "right_e1 at its speed limit 1.5 rad/s" in reasons
    assert not [r for r in reasons if "_w" in r]


def test_an_obstacle_in_the_arm_s_way_is_named_with_the_link():
    blocked = replace(BOX, environment=(*BOX.environment, POST))
    reasons = assert_stopped(blocked, "post within 5 mm of left_", 5.0, 15.0)
    assert not [r for r in reasons if "right" in r]


def test_an_approach_that_is_too_fast_is_refused_with_the_gap_that_is_left():
    hasty = tuple(replace(p, duration_s=0.01) if p.name == "touch" else p for p in BOX.phases)
    with pytest.raises(PathError, match=r"left_e1 at its speed limit 1\.5 rad/s") as error:
        plan_joints(replace(BOX, phases=hasty))
    # Somewhere on the last 5 mm, before anything is tilted.
    assert error.value.tilt_deg == 0.0
    assert re.search(r"hands [1-4] mm off their contacts", str(error.value))


def test_a_contact_point_that_is_no_number_is_refused_by_name():
    with pytest.raises(InvalidInputError, match=r"left\.p_OC_O: got \(nan, .*finite numbers"):
        replace(BOX.hands[0], p_OC_O=(np.nan, 0.1, 0.0))


def with_robot(tmp_path, edit):
    """The box scene with an edited copy of Baxter."""
    spec = mujoco.MjSpec.from_file(str(asset_path("baxter.xml")))
    edit(spec)
    spec.compile()
    copy = tmp_path / "edited.xml"
    copy.write_text(spec.to_xml())
    return replace(BOX, robots=(replace(BOX.robots[0], model=str(copy)),))


@pytest.mark.parametrize(
    ("side", "low", "high", "reason"),
    [
        ("left", -1.1, -0.7, "left_w2 at its upper limit -0.700 rad"),
        ("right", 0.7, 1.1, "right_w2 at its lower limit 0.700 rad"),
    ],
)
def test_a_joint_range_in_the_way_is_named(tmp_path, side, low, high, reason):
    def narrow(spec):
        spec.joint(f"{side}_w2").range = [low, high]

    edited = with_robot(tmp_path, narrow)
    # The unrestricted path leaves that range soon; the arm's redundancy makes up for it till late.
    reasons = assert_stopped(edited, reason, 45.0, 89.0)
    assert all(r.startswith(side) for r in reasons)


def test_an_unedited_copy_of_the_robot_is_planned_alike(tmp_path):
    edited = with_robot(tmp_path, lambda spec: None)
    # The copy is printed with six digits; the largest joint angle is 2 rad.
    for q, expected in zip(plan_joints(edited).q, planned("box-tilt").q, strict=True):
        np.testing.assert_allclose(q, expected, rtol=0, atol=1e-4)


def test_limits_of_a_slide_are_in_metres(tmp_path):
    def on_a_rail(spec):
        rail = spec.joint("left_s0")
        rail.type, rail.axis = mujoco.mjtJoint.mjJNT_SLIDE, [1.0, 0.0, 0.0]
        rail.range = [-0.05, 0.05]

    edited = with_robot(tmp_path, on_a_rail)
    (robot,) = edited.robots
    robot = replace(robot, posture={**robot.posture, "left_s0": 0.0})
    with pytest.raises(PathError) as error:
        plan_joints(moved(replace(edited, robots=(robot,)), 0.4))
    told = [r for r in error.value.reasons if "left_s0" in r]
    assert told
    assert all(re.search(r"limit -?0\.05\d* m$", r) for r in told), told
