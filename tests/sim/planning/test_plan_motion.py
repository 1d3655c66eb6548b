import math
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.model.contacts import ContactFrames
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.planning.problem import tilting_curve
from fulcrum.synthesis import InvalidInputError
from tests.helpers.plans import BOX, NAMES, fastest

# --- geometry


def test_derivatives_of_the_screw_are_those_of_its_poses():
    pivot = replace(scenario(BOX).path, pitch=0.03, travel=(0.01, -0.02, 0.05))
    path, p_O, h = ScrewPath(pivot), np.array([0.1, -0.2, 0.05]), 1e-4

    def place(tilt):
        R_WO, p_WO = path.pose(tilt)
        return p_WO + R_WO @ p_O

    for tilt in (0.1, 0.7, 1.5):
        slope, curvature = path.derivatives(tilt, p_O)
        central = (place(tilt + h) - place(tilt - h)) / (2.0 * h)
        second = (place(tilt + h) - 2.0 * place(tilt) + place(tilt - h)) / h**2
        # Central differences: h^2 / 6 of the third derivative; rounding over h^2.
        assert slope == pytest.approx(central, abs=1e-8)
        assert curvature == pytest.approx(second, abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_the_hands_move_with_the_object_to_1e_6(name):
    chosen, curve = scenario(name), fastest(name).q
    robot, path, frames = RobotModel(chosen), ScrewPath(chosen.path), ContactFrames(chosen)
    hands = len(chosen.hands)
    for s in np.linspace(0.0, 1.0, 31):
        R_WO, p_WO = path.pose(path.end * s)
        axes = frames.in_world(R_WO)[:hands]
        state = robot.at(curve(s))
        J_C = state.contact_jacobians(frames.points(R_WO, p_WO)[:hands], axes)
        for i, (J, R_WC) in enumerate(zip(J_C, axes, strict=True)):
            slope, _ = path.derivatives(path.end * s, frames.p_OC_O[i])
            twist = path.end * np.concatenate([R_WC.T @ slope, R_WC.T @ path.direction])
            assert J @ curve(s, 1) == pytest.approx(twist, abs=1e-6)


def test_the_curve_of_a_tilt_that_turns_back_is_refused():
    chosen = scenario(BOX)
    phases = tuple(
        replace(phase, tilt=0.5) if phase.name == "set down" else phase for phase in chosen.phases
    )
    schedule = Schedule(replace(chosen, phases=phases))
    with pytest.raises(InvalidInputError, match="set down"):
        tilting_curve(replace(plan_joints(chosen), schedule=schedule))


# --- the plan in time


@pytest.mark.parametrize("name", NAMES)
def test_a_plan_goes_from_rest_to_rest_and_its_times_are_exact(name):
    found = fastest(name)
    first, last = found.at(0.0), found.at(found.duration)
    assert (first.tilt, first.rate) == (0.0, 0.0)
    assert last.tilt == pytest.approx(math.radians(scenario(name).path.angle_deg), rel=1e-12)
    assert last.rate == pytest.approx(0.0, abs=1e-6)
    after = found.at(found.duration + 1.0)
    assert (after.rate, after.acceleration) == (0.0, 0.0)
    assert after.qd == pytest.approx(0.0)
    for k in range(1, len(found.times) - 1, 9):
        there = found.at(float(found.times[k]))
        assert there.tilt == pytest.approx(found.tilt[k], rel=1e-12)
    # Rate and acceleration are the derivatives of the tilt, inside an interval.
    t, h = float(found.times[50:52].mean()), 1e-5
    before, now, later = found.at(t - h), found.at(t), found.at(t + h)
    assert now.rate == pytest.approx((later.tilt - before.tilt) / (2 * h), rel=1e-8)
    assert now.qd == pytest.approx((later.q - before.q) / (2 * h), abs=1e-7)
    assert now.qdd == pytest.approx((later.qd - before.qd) / (2 * h), abs=1e-5)
    assert now.acceleration == pytest.approx((later.rate - before.rate) / (2 * h), rel=1e-6)
