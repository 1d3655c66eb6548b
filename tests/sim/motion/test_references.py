"""The table of references is what schedule and joint path say, at every tick and between."""

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.references import References
from tests.helpers.runs import NAMES

TIMESTEP = 0.001


def directly(path, t):
    """Tilt, grip, angles and their derivatives at a time, from schedule and joint path."""
    asked = path.schedule.at(t)
    q, slope = path.at(int(asked.phase), float(asked.progress))
    curvature = path.curvature(int(asked.phase), float(asked.progress))
    qdd = slope * asked.acceleration + curvature * asked.rate**2
    rate, acceleration = asked.turn * asked.rate, asked.turn * asked.acceleration
    return int(asked.phase), asked.tilt, asked.grip, q, slope * asked.rate, rate, acceleration, qdd


@pytest.mark.parametrize("name", NAMES)
def test_the_table_gives_what_the_path_gives(name):
    path = plan_joints(scenario(name))
    references, t = References(path, TIMESTEP), 0.0
    for tick in range(round(path.schedule.total_s / TIMESTEP)):
        if tick % 97 == 0:
            found = references.at(t)
            for got, expected in zip(found, directly(path, t), strict=True):
                # The same polynomials; vectorised, their sums may differ in the last bits.
                np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12)
        t += TIMESTEP  # as a plant's clock does, with its rounding


def test_times_off_the_clock_and_after_the_end_are_computed():
    path = plan_joints(scenario("box-tilt"))
    references = References(path, TIMESTEP)
    for t in (0.00037, 5.00061, path.schedule.total_s + 1.0):
        for got, expected in zip(references.at(t), directly(path, t), strict=True):
            np.testing.assert_array_equal(got, expected)
    # Another time is told apart: the table is not one row for all.
    assert not np.array_equal(references.at(5.0).q, references.at(6.0).q)


def test_speeds_and_accelerations_are_derivatives_by_time():
    path, h = plan_joints(scenario("box-tilt")), 1e-4
    references = References(path, TIMESTEP)
    for t in (3.91037, 7.00061):
        before, now, after = (references.at(t + dt) for dt in (-h, 0.0, h))
        # Central differences: h^2 / 6 of the third derivative.
        np.testing.assert_allclose(now.rate, (after.tilt - before.tilt) / (2 * h), rtol=1e-6)
        np.testing.assert_allclose(now.qdd, (after.qd - before.qd) / (2 * h), rtol=0, atol=1e-5)
        change = (after.rate - before.rate) / (2 * h)
        np.testing.assert_allclose(now.acceleration, change, rtol=1e-6)
        assert abs(now.acceleration) > 0.01


def test_a_slower_clock_slows_all_of_the_motion():
    at_half = References(plan_joints(scenario("box-tilt")), TIMESTEP).at(5.0).on_clock(0.5, 2.0)
    full = References(plan_joints(scenario("box-tilt")), TIMESTEP).at(5.0)
    assert at_half.tilt == full.tilt
    assert at_half.rate == 0.5 * full.rate
    assert at_half.acceleration == pytest.approx(0.25 * full.acceleration + 2.0 * full.rate)
    np.testing.assert_allclose(at_half.qd, 0.5 * full.qd, rtol=1e-15)
    np.testing.assert_allclose(at_half.qdd, 0.25 * full.qdd + 2.0 * full.qd, rtol=1e-14)
