"""The table of references is what schedule and joint path say, at every tick and between."""

import numpy as np
import pytest

from scenarios import scenario
from sim.ik import plan_joints
from sim.references import References
from tests.runs import NAMES

TIMESTEP = 0.001


def directly(path, t):
    """Tilt, grip, angles and speeds at a time, from schedule and joint path."""
    asked = path.schedule.at(t)
    q, slope = path.at(int(asked.phase), float(asked.progress))
    return int(asked.phase), asked.tilt, asked.grip, q, slope * asked.rate


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
