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
