"""The estimate of the object's pose follows its path without lag, and smooths what is off it."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.control.controller import ForceController
from fulcrum.sim.control.observer import PoseObserver
from fulcrum.sim.model.object_path import ScrewPath, minimum_jerk
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.signals.measurement import Measurement

BOX, CYLINDER = scenario("box-tilt"), scenario("cylinder-tilt")
PATHS = {
    "box": BOX.path,
    "cylinder": CYLINDER.path,
    "cylinder on a screw": replace(CYLINDER.path, pitch=0.05, travel=(0.02, -0.01, 0.1)),
}
each_path = pytest.mark.parametrize("pivot", PATHS.values(), ids=PATHS)
# Time between syntheses [s].
T = 0.004
# Quaternions and positions of 1 m, a few hundred times turned on by a few roundings of 2e-16.
ROUNDING = 1e-12


def poses(pivot, tilts):
    """Positions, (k, 3), and orientations, (k, 4), of the object at tilts [rad], (k,)."""
    path = ScrewPath(pivot)
    R_WO, p_WO = zip(*(path.pose(float(tilt)) for tilt in tilts), strict=True)
    return np.array(p_WO), Rotation.from_matrix(np.array(R_WO)).as_quat(scalar_first=True)


def shifted(pivot):
    """The same screw for an object that starts a little beside."""
    x, y, z = pivot.start.position
    turned = Rotation.from_rotvec([0.02, -0.03, 0.01]) * Rotation.from_quat(
        pivot.start.quaternion, scalar_first=True
    )
    position, quaternion = (x + 0.01, y - 0.02, z + 0.03), turned.as_quat(scalar_first=True)
    return replace(pivot, start=replace(pivot.start, position=position, quaternion=quaternion))


def estimates(pivot, tau, t, p_WO, quat_WO, tilt_ref):
    """What an observer makes of rows of measurements: positions, (k, 3), and orientations."""
    observer = PoseObserver(ScrewPath(pivot), tau)
    rows = [observer.update(*row) for row in zip(t, p_WO, quat_WO, tilt_ref, strict=True)]
    p, quat = zip(*rows, strict=True)
    return np.array(p), np.array(quat)


def turns(quat_WO, quat_est):
    """Rotation vectors between orientations [rad], (k, 3)."""
    measured, estimated = (Rotation.from_quat(q, scalar_first=True) for q in (quat_WO, quat_est))
    return (estimated.inv() * measured).as_rotvec()


def motion(pivot, steps):
    """Times [s] and tilts [rad], (k,), of minimum jerk over the path."""
    return T * np.arange(steps), ScrewPath(pivot).end * minimum_jerk(np.linspace(0.0, 1.0, steps))[
        0
    ]


# --- along the path ---


@each_path
@pytest.mark.parametrize("tau", [0.01, 1.0])
def test_exact_measurements_along_the_path_are_followed_without_lag(pivot, tau):
    t, tilts = motion(pivot, 500)
    p_WO, quat_WO = poses(pivot, tilts)
    p, quat = estimates(pivot, tau, t, p_WO, quat_WO, tilts)
    np.testing.assert_allclose(p, p_WO, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(turns(quat_WO, quat), 0.0, rtol=0, atol=ROUNDING)


@each_path
def test_an_observer_that_is_not_told_of_the_motion_lags_by_the_time_constant(pivot):
    # At constant speed v, with the share a of each step, the lag settles at v T (1 - a) / a.
    tau, speed = 0.05, 0.2
    t = T * np.arange(500)
    p_WO, quat_WO = poses(pivot, speed * t)
    _, quat = estimates(pivot, tau, t, p_WO, quat_WO, 0.0 * t)
    a = 1.0 - np.exp(-T / tau)
    lag = np.linalg.norm(turns(quat_WO, quat)[-1])
    # What is left of settling is exp(-40).
    assert lag == pytest.approx(speed * T * (1.0 - a) / a, rel=1e-9)
    # Which is v tau, but for half a step.
    assert lag == pytest.approx(speed * (tau - T / 2.0), rel=1e-2)


@each_path
def test_a_pitch_or_travel_that_the_observer_does_not_know_is_a_lag_in_position(pivot):
    other = replace(pivot, pitch=pivot.pitch + 0.1)
    t, tilts = motion(other, 500)
    p_WO, quat_WO = poses(other, tilts)
    p, quat = estimates(pivot, 0.05, t, p_WO, quat_WO, tilts)
    # 0.1 m/rad at up to 1 rad/s or so, over 50 ms.
    assert np.abs(p - p_WO).max() > 1e-3
    np.testing.assert_allclose(turns(quat_WO, quat), 0.0, rtol=0, atol=ROUNDING)


# --- off the path ---


@pytest.mark.parametrize("tau", [0.01, 0.03])
def test_noise_is_reduced_by_the_factor_of_a_first_order_filter(tau):
    pivot, rng, steps = PATHS["cylinder on a screw"], np.random.default_rng(0), 6000
    # Up and down, again and again.
    way = np.abs((np.arange(steps) + 300) % 600 - 300)
    _, tilts = motion(pivot, 301)
    p_WO, quat_WO = (rows[way] for rows in poses(pivot, tilts))
    t, tilts = T * np.arange(steps), tilts[way]
    p_noise, turn_noise = 1e-3 * rng.standard_normal((2, steps, 3))
    true = Rotation.from_quat(quat_WO, scalar_first=True)
    noisy = (true * Rotation.from_rotvec(turn_noise)).as_quat(scalar_first=True)
    p, quat = estimates(pivot, tau, t, p_WO + p_noise, noisy, tilts)
    a = 1.0 - np.exp(-T / tau)
    expected = np.sqrt(a / (2.0 - a))
    settled = int(10.0 * tau / T)
    for error, noise in ((p - p_WO, p_noise), (turns(quat_WO, quat), turn_noise)):
        found = error[settled:].std() / noise[settled:].std()
        # Successive estimates are alike over 2 tau: 18,000 numbers count for 1,200 or more, whose
        # deviation is known to 1 / sqrt(2 * 1,200) = 2 %. Half or twice tau is 40 % off.
        assert found == pytest.approx(expected, rel=0.06)
        # No bias: of 1,200 numbers the mean is within 3 %, at three sigma 9 % of the deviation.
        assert np.abs(error[settled:].mean()) < 0.1 * error[settled:].std()


@each_path
@pytest.mark.parametrize("regular", [True, False], ids=["regular", "irregular"])
def test_a_jump_is_followed_with_the_time_constant_whatever_the_motion_and_the_ticks(
    pivot, regular
):
    tau, before, steps = 0.05, 50, 400
    t, tilts = motion(pivot, steps)
    if not regular:
        t = np.cumsum(np.random.default_rng(1).uniform(0.001, 0.009, steps))
    p_WO, quat_WO = poses(shifted(pivot), tilts)
    p_on_path, quat_on_path = poses(pivot, tilts[:before])
    jumped = np.concatenate([p_on_path, p_WO[before:]])
    jumped_quat = np.concatenate([quat_on_path, quat_WO[before:]])
    p, quat = estimates(pivot, tau, t, jumped, jumped_quat, tilts)
    left = np.exp(-(t[before:] - t[before - 1]) / tau)
    # The object that jumped turns on about the same screw, so that what is left only decays.
    offset = np.linalg.norm(p_on_path[0] - poses(shifted(pivot), tilts[:1])[0][0])
    distance = np.linalg.norm((p - p_WO)[before:], axis=1)
    np.testing.assert_allclose(distance, offset * left, rtol=0, atol=ROUNDING)
    angle = np.linalg.norm(turns(quat_WO, quat)[before:], axis=1)
    whole = np.linalg.norm([0.02, -0.03, 0.01])
    np.testing.assert_allclose(angle, whole * left, rtol=0, atol=ROUNDING)
    # The jump is neither taken at once nor ignored.
    assert left[0] > 0.8 and left[-1] < 1e-6


def test_the_sign_of_a_measured_quaternion_does_not_matter():
    t, tilts = motion(BOX.path, 100)
    p_WO, quat_WO = poses(shifted(BOX.path), tilts)
    p, quat = estimates(BOX.path, 0.05, t, p_WO, quat_WO, tilts)
    sign = np.where(np.arange(100) % 3, 1.0, -1.0)[:, None]
    p_other, quat_other = estimates(BOX.path, 0.05, t, p_WO, sign * quat_WO, tilts)
    np.testing.assert_allclose(p_other, p, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(turns(quat, quat_other), 0.0, rtol=0, atol=ROUNDING)


# --- what goes in and comes out ---


def test_without_a_time_constant_the_measurement_is_handed_on():
    observer = PoseObserver(ScrewPath(BOX.path), 0.0)
    for t in (0.0, 1.0):
        p_WO, quat_WO = np.array([t, 2.0, 3.0]), np.array([0.0, 1.0, 0.0, 0.0])
        p, quat = observer.update(t, p_WO, quat_WO, t)
        assert p is p_WO and quat is quat_WO


def test_estimates_and_measurements_stay_as_they_were_given():
    t, tilts = motion(BOX.path, 20)
    p_WO, quat_WO = poses(shifted(BOX.path), tilts)
    observer, kept = PoseObserver(ScrewPath(BOX.path), 0.05), []
    for row in zip(t, p_WO.copy(), quat_WO.copy(), 0.0 * tilts, strict=True):
        estimate = observer.update(*row)
        kept.append((*row[1:3], *estimate, *(np.array(e) for e in estimate)))
    for i, (p_in, quat_in, p, quat, p_then, quat_then) in enumerate(kept):
        np.testing.assert_array_equal(p_in, p_WO[i])
        np.testing.assert_array_equal(quat_in, quat_WO[i])
        np.testing.assert_array_equal(p, p_then)
        np.testing.assert_array_equal(quat, quat_then)


def commanded(pose_filter_s, turn):
    """Forces commanded for the box at 30 deg, and 4 ms later for one measured turned [rad]."""
    control = replace(BOX.control, solve_every=1, pose_filter_s=pose_filter_s)
    joint_path, schedule = plan_joints(BOX), Schedule(BOX)
    t = float(schedule.ends[2]) + 3.0
    tilt = schedule.at(t).tilt
    q = joint_path.holding(tilt)
    (p_WO,), (quat_WO,) = poses(BOX.path, [tilt])
    controller = ForceController(control, joint_path)
    controller.reset(BOX, RobotModel(BOX), seed=0)
    turned = quat_WO.copy()
    mujoco.mju_quatIntegrate(turned, np.array([0.0, -turn, 0.0]), 1.0)
    rows, none = ((t, quat_WO), (t + T, turned)), np.zeros(len(q))
    return [
        controller.command(Measurement(at, q, none, p_WO, quat, none)).w_commanded_C
        for at, quat in rows
    ]


def test_the_controller_synthesises_for_the_smoothed_pose():
    # A hundredth of the time constant lets through a hundredth of the measured turn.
    first, smoothed = commanded(100.0 * T, 0.05)
    again, raw = commanded(0.0, 0.05)
    np.testing.assert_array_equal(again, first)
    assert np.abs(raw - first)[:2, 2].min() > 0.5
    assert np.abs(smoothed - first).max() < 0.1 * np.abs(raw - first).max()
