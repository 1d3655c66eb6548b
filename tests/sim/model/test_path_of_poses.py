"""A path through poses: it is the screw that they lie on, smooth, read back, and refused if odd."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.control.observer import PoseObserver
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.inertia import inertial_wrenches
from fulcrum.sim.model.object_path import PosesPath, ScrewPath, check_supports, object_path
from fulcrum.sim.model.scene import compose
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.planning.plan import plan
from fulcrum.sim.planning.problem import Margins
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.scenario.control import controllers
from fulcrum.sim.scenario.path import Poses
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError
from tests.helpers.short_run import short_tilt

# scipy finds the rates of a rotation spline to 1e-9; between poses that turns by less.
SPLINE = 1e-9

BOX = scenario("box-tilt")
SCREW = replace(BOX.path, pitch=0.05)


def sampled(pivot, *tilts_deg):
    """Poses of a screw at tilts."""
    path = ScrewPath(pivot)
    poses = [path.pose(np.radians(tilt)) for tilt in tilts_deg]
    return Poses(tuple(Pose(tuple(p.tolist()), quaternion(R)) for R, p in poses))


def quaternion(R):
    return tuple(Rotation.from_matrix(R).as_quat(scalar_first=True).tolist())


def curved():
    """Poses whose axis and place change all along."""
    turn = Rotation.identity()
    poses = []
    for i in range(7):
        p = (0.1 * np.sin(0.5 * i), 0.02 * i**1.5, 0.3 * np.cos(0.4 * i))
        poses.append(Pose(p, tuple(turn.as_quat(scalar_first=True).tolist())))
        turn = Rotation.from_rotvec([0.1 + 0.03 * i, 0.25 - 0.02 * i, 0.05 * i]) * turn
    return Poses(tuple(poses))


def place(path, tilt, p_O):
    R_WO, p_WO = path.pose(tilt)
    return p_WO + R_WO @ p_O


# --- the poses of a screw give the screw ---


@pytest.mark.parametrize("tilts", [(0, 90), (0, 40, 90), (0, 10, 45, 50, 90)])
def test_poses_on_a_screw_give_that_screw(tilts):
    screw, path = ScrewPath(SCREW), object_path(sampled(SCREW, *tilts))
    assert isinstance(path, PosesPath)
    assert path.end == pytest.approx(screw.end, abs=1e-12)
    p_O, center = np.array([0.1, -0.2, 0.05]), np.array([0.02, 0.0, 0.01])
    # On it, and beyond its ends, where measured tilts may be.
    for tilt in np.linspace(-0.1, screw.end + 0.1, 14):
        for mine, exact in zip(path.pose(tilt), screw.pose(tilt), strict=True):
            np.testing.assert_allclose(mine, exact, rtol=0, atol=SPLINE)
        for mine, exact in zip(
            path.derivatives(tilt, p_O), screw.derivatives(tilt, p_O), strict=True
        ):
            np.testing.assert_allclose(mine, exact, rtol=0, atol=10.0 * SPLINE)
        np.testing.assert_allclose(path.axis(tilt), screw.axis(tilt), rtol=0, atol=SPLINE)
        thing = replace(BOX, object=replace(BOX.object, center_of_mass=tuple(center)))
        for mine, exact in zip(
            inertial_wrenches(thing, path, tilt), inertial_wrenches(thing, screw, tilt), strict=True
        ):
            np.testing.assert_allclose(mine, exact, rtol=0, atol=10.0 * SPLINE)
    # Another screw is not given.
    other = ScrewPath(replace(SCREW, pitch=0.06))
    assert np.abs(path.pose(1.0)[1] - other.pose(1.0)[1]).max() > 5e-3


def test_tilt_and_observer_are_those_of_the_screw():
    screw, path = ScrewPath(SCREW), object_path(sampled(SCREW, 0, 30, 60, 90))
    random = np.random.default_rng(0)
    tilts = np.linspace(-0.1, screw.end + 0.1, 40)
    off = Rotation.from_rotvec(0.01 * random.standard_normal((40, 3)))
    turns = off * Rotation.from_matrix([screw.pose(tilt)[0] for tilt in tilts])
    q = turns.as_quat(scalar_first=True)
    np.testing.assert_allclose(path.tilt(q), screw.tilt(q), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(path.tilt(-q), path.tilt(q))
    np.testing.assert_array_equal(path.tilt(q), [path.tilt(one) for one in q])
    observers = [PoseObserver(p, 0.05) for p in (path, screw)]
    for i, tilt in enumerate(tilts.clip(0.0, screw.end)):  # references stay on the path
        p_WO = screw.pose(tilt)[1] + 0.01 * random.standard_normal(3)
        found = [observer.update(0.004 * i, p_WO, q[i], tilt) for observer in observers]
        for mine, exact in zip(*found, strict=True):
            np.testing.assert_allclose(mine, exact, rtol=0, atol=1e-7)


def test_a_run_and_a_plan_through_poses_are_those_of_the_screw():
    screw = short_tilt(6.0, 1.0)
    poses = replace(screw, path=sampled(screw.path, 0, 2, 6))
    tilts = []
    for chosen in (screw, poses):
        loop = closed_loop(chosen, controllers(chosen.control)["robust"])
        assert sum(len(block) for block in loop.run()) == loop.steps
        assert not loop.controller.events and not loop.plant.collisions
        tilts.append(loop.trace.tilt)
    # The same but for what 1e-9 rad does to contact forces.
    np.testing.assert_allclose(tilts[1], tilts[0], rtol=0, atol=1e-6)
    assert tilts[1][-1] == pytest.approx(np.radians(6.0), abs=1e-3)
    durations = [
        plan(replace(BOX, path=path), Margins(), points=20).duration
        for path in (BOX.path, sampled(BOX.path, 0, 40, 90))
    ]
    assert durations[1] == pytest.approx(durations[0], rel=1e-5)


# --- any poses ---


def test_a_curved_path_passes_its_poses_and_is_smooth():
    poses = curved()
    path = PosesPath(poses)
    for tilt, pose in zip(poses.tilts, poses.poses, strict=True):
        R_WO, p_WO = path.pose(tilt)
        np.testing.assert_allclose(p_WO, pose.position, rtol=0, atol=1e-12)
        turn = Rotation.from_quat(pose.quaternion, scalar_first=True).as_matrix()
        np.testing.assert_allclose(R_WO, turn, rtol=0, atol=1e-12)
    p_O, h = np.array([0.1, -0.2, 0.05]), 1e-4
    for tilt in (*(poses.tilts[1:-1] + 1e-9), 0.3, 1.1):
        low, mid, high = (place(path, tilt + step, p_O) for step in (-h, 0.0, h))
        slope, curvature = path.derivatives(tilt, p_O)
        # Central differences: third derivatives of up to 10 jump at the poses.
        np.testing.assert_allclose(slope, (high - low) / (2.0 * h), rtol=0, atol=1e-6)
        np.testing.assert_allclose(curvature, (high - 2.0 * mid + low) / h**2, rtol=0, atol=2e-3)
        alpha = (path.axis(tilt + h) - path.axis(tilt - h)) / (2.0 * h)
        np.testing.assert_allclose(path.axis_slope(tilt), alpha, rtol=0, atol=2e-3)
        assert np.abs(alpha).max() > 0.02  # a path about a fixed axis would have none


def test_the_inertia_of_a_curved_path_is_that_of_mujoco():
    """Of a free body that moves so; a wrong angular acceleration is caught."""
    thing = replace(BOX, path=curved(), supports=())
    path = object_path(thing.path)
    model = compose(replace(thing, hands=())).compile()
    data, free = mujoco.MjData(model), model.joint("box")
    q, v, tilt = int(free.qposadr[0]), int(free.dofadr[0]), 0.8
    w_a, w_b = inertial_wrenches(thing, path, tilt)
    R_WO, p_WO = path.pose(tilt)
    rate, acceleration = 0.7, -1.3
    slope, curvature = path.derivatives(tilt, np.zeros(3))
    omega, alpha = path.axis(tilt), path.axis_slope(tilt)
    data.qpos[q : q + 7] = [*p_WO, *quaternion(R_WO)]
    data.qvel[v : v + 6] = [*(rate * slope), *(R_WO.T @ omega * rate)]
    turning = acceleration * omega + rate**2 * alpha
    data.qacc[v : v + 6] = [*(acceleration * slope + rate**2 * curvature), *(R_WO.T @ turning)]
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    mujoco.mj_inverse(model, data)
    force, moment = data.qfrc_inverse[v : v + 3], data.qfrc_inverse[v + 3 : v + 6]
    expected = np.concatenate([R_WO.T @ force, moment])
    found = acceleration * w_a + rate**2 * w_b
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    without = found[3:] - rate**2 * np.array(thing.object.inertia) * (R_WO.T @ alpha)
    assert np.abs(without - expected[3:]).max() > 1e-5


def test_tilt_inverts_a_curved_path():
    path = PosesPath(curved())
    tilts = np.linspace(0.0, path.end, 50)
    q = np.array([quaternion(path.pose(tilt)[0]) for tilt in tilts])
    np.testing.assert_allclose(path.tilt(q), tilts, rtol=0, atol=1e-12)
    # A turn across the axis is no tilt, one about it is.
    R_WO, axis = path.pose(1.0)[0], path.axis(1.0) / np.linalg.norm(path.axis(1.0))
    across = np.cross(axis, [0.0, 0.0, 1.0])
    for turn, expected in ((0.02 * across, 1.0), (0.02 * axis, 1.02)):
        moved = quaternion(Rotation.from_rotvec(turn).as_matrix() @ R_WO)
        # The axis turns by 0.02 times what it changes per tilt; its length is not quite 1.
        assert path.tilt(np.array(moved)) == pytest.approx(expected, abs=2e-3)


def test_the_schedule_and_a_larger_world_follow_poses():
    chosen = replace(BOX, path=sampled(BOX.path, 0, 30, 90))
    assert Schedule(chosen).end == pytest.approx(np.pi / 2.0, abs=1e-12)
    np.testing.assert_allclose(chosen.path.pivot_O[[0, 2]], [-0.15, -0.05], rtol=0, atol=1e-12)
    truth = World(size=1.1).truth(chosen)
    check_supports(truth)  # its larger edge stays where the edge was
    expected = World(size=1.1).truth(BOX)
    mine, exact = object_path(truth.path), object_path(expected.path)
    np.testing.assert_allclose(mine.pose(0.9)[1], exact.pose(0.9)[1], rtol=0, atol=SPLINE)


# --- refusals ---


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        (lambda: sampled(SCREW, 0), r"path\.poses: got 1 poses; valid is at least two"),
        (lambda: sampled(SCREW, 0, 30, 30), r"a turn of .* from pose 2 to pose 3; valid is more"),
        (
            lambda: Poses((Pose(), Pose((0.1, 0.0, 0.0)))),
            r"a turn of 0 deg from pose 1 to pose 2; .*the tilt is what the object has turned",
        ),
        (lambda: sampled(SCREW, 0, 90, 170, 185), r"turns of 185.0 deg in all"),
    ],
)
def test_poses_that_are_no_path_are_refused(poses, message):
    with pytest.raises(InvalidInputError, match=message):
        poses()


def test_a_path_that_turns_back_is_refused():
    with pytest.raises(InvalidInputError, match="nearly the same orientation at tilts of"):
        object_path(sampled(SCREW, 0, 40, 10))


def test_poses_that_move_a_support_are_refused_with_the_distance():
    compose(replace(BOX, path=sampled(BOX.path, 0, 30, 60, 90)))
    sliding = sampled(replace(BOX.path, travel=(0.003, 0.0, 0.0)), 0, 30, 60, 90)
    message = r"edge_left moved by 0\.1\d? mm at a tilt of \d.*valid is poses that keep every"
    with pytest.raises(InvalidInputError, match=r"edge_left moved by 3 mm at a tilt of 90"):
        compose(replace(BOX, path=sliding))
    # A twentieth of a millimetre is let through, a tenth and a bit is not.
    compose(replace(BOX, path=sampled(replace(BOX.path, travel=(5e-5, 0, 0)), 0, 30, 60, 90)))
    with pytest.raises(InvalidInputError, match=message):
        compose(replace(BOX, path=sampled(replace(BOX.path, travel=(1.2e-4, 0, 0)), 0, 90)))
