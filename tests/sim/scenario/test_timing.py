import math

import numpy as np
import pytest

from fulcrum.sim.scenario.phases import Phase, stretched
from fulcrum.sim.scenario.timing import Timing
from fulcrum.synthesis import InvalidInputError

# Half of the way with 2 1/s^2, half with -2 1/s^2: a second in all.
THERE = Timing((0.0, 0.5, 1.0), (0.0, 4.0 * 0.5, 0.0))
BANG = 2.0 * math.sqrt(2.0 * 0.5 / 2.0)


def test_it_goes_at_constant_acceleration_and_ends_in_time():
    assert THERE.duration == pytest.approx(BANG, rel=1e-14)
    t = np.array([0.1, 0.3])
    progress, rate, acceleration = THERE.at(t)
    np.testing.assert_allclose(progress, t**2, rtol=1e-14)
    np.testing.assert_allclose(rate, 2.0 * t, rtol=1e-14)
    np.testing.assert_allclose(acceleration, 2.0, rtol=1e-14)
    later = THERE.at(BANG - t)
    np.testing.assert_allclose(later[0], 1.0 - t**2, rtol=1e-13)
    np.testing.assert_allclose(later[2], -2.0, rtol=1e-14)


def test_before_and_after_it_rests():
    for t, place in ((-1.0, 0.0), (BANG, 1.0), (9.0, 1.0)):
        assert [float(x) for x in THERE.at(t)] == pytest.approx([place, 0.0, 0.0], abs=1e-14)


def test_times_are_those_at_which_it_gets_there():
    p = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(THERE.at(THERE.times(p))[0], p, rtol=0, atol=1e-14)


def test_another_timing_goes_on_from_where_it_begins_at_its_own_rate():
    rest = np.array([0.3, 0.6, 1.0]), np.array([0.04, 0.5, 0.0])
    whole = THERE.continued(*rest)
    t = float(whole.times(0.3))
    assert t == pytest.approx(math.sqrt(0.3), rel=1e-14)  # as before the change
    before, after = whole.at(t - 1e-9), whole.at(t + 1e-9)
    assert before[1] == pytest.approx(2.0 * t, rel=1e-6)
    assert after[1] == pytest.approx(0.2, rel=1e-6)
    assert after[0] == pytest.approx(before[0], abs=1e-8)
    steps = [2.0 * 0.3 / (0.2 + math.sqrt(0.5)), 2.0 * 0.4 / math.sqrt(0.5)]
    assert whole.duration == pytest.approx(t + sum(steps), rel=1e-12)


def test_a_timing_may_be_continued_from_rest_and_more_than_once():
    once = THERE.continued(np.array([0.3, 1.0]), np.array([0.0, 0.7]))
    assert float(once.at(float(once.times(0.3)) + 1e-9)[1]) < 1e-6
    twice = once.continued(np.array([0.6, 1.0]), np.array([0.1, 0.0]))
    assert float(twice.times(0.6)) == pytest.approx(float(once.times(0.6)), rel=1e-12)


@pytest.mark.parametrize(
    ("progress", "squared_rates"),
    [
        ((0.0, 1.0), (0.0,)),
        ((0.0,), (0.0,)),
        ((0.0, 0.6, 0.5, 1.0), (0.0, 1.0, 1.0, 0.0)),
        ((0.1, 1.0), (0.0, 1.0)),
        ((0.0, 0.9), (0.0, 1.0)),
        ((0.0, 1.0), (0.0, 0.0)),
        ((0.0, 1.0), (0.0, -1.0)),
        ((0.0, 1.0), (0.0, math.inf)),
        ((0.0, math.nan, 1.0), (0.0, 1.0, 0.0)),
    ],
)
def test_what_is_no_motion_is_refused(progress, squared_rates):
    with pytest.raises(InvalidInputError, match="timing"):
        Timing(progress, squared_rates)


def test_a_phase_lasts_as_long_as_its_timing():
    phase = Phase("tilt", THERE.duration, tilt=1.0, gap=0.0, grip=1.0, timing=THERE)
    with pytest.raises(InvalidInputError, match=r"tilt\.duration_s"):
        Phase("tilt", 2.0, tilt=1.0, gap=0.0, grip=1.0, timing=THERE)
    # Stretched by hand it goes along minimum jerk again.
    (longer,) = stretched((phase,), 3.0)
    assert (longer.timing, longer.duration_s) == (None, 3.0)
