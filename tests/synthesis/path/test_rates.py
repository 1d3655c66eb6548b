import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.planning.problem import path_problem
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.path import synthesizer as path_synthesizer
from fulcrum.synthesis.path.problem import PathObjective
from fulcrum.synthesis.path.solution import InfeasiblePathError
from fulcrum.synthesis.path.synthesizer import solve_path
from tests.helpers.paths import FORCE, LENGTH, MASS, carriage
from tests.helpers.plans import BOX, MARGINS

RATE = 30.0


@pytest.fixture(scope="module")
def box():
    """The box's path on a coarse grid."""
    return path_problem(scenario(BOX), MARGINS[BOX], 31)[0]


@pytest.fixture(scope="module")
def quick(box):
    return solve_path(box)


@pytest.fixture(scope="module")
def gentle(box):
    return solve_path(replace(box, force_rate=RATE))


def profile(found):
    """Forces over time: the mean of each interval in its middle, and those at rest at both ends."""
    count = len(found.times) - 1
    w_OC_C = found.w_OC_C[0][..., :3]
    middle = (found.times[:-1] + found.times[1:]) / 2.0
    mean = (w_OC_C[0 : 2 * count : 2] + w_OC_C[1 : 2 * count : 2]) / 2.0
    if len(w_OC_C) == 2 * count:
        return middle, mean
    first, last = w_OC_C[-2:]
    return np.array([0.0, *middle, found.duration]), np.array([first, *mean, last])


def steepest(found):
    """The largest rate of the forces' profile [N/s], sampled twenty times per interval."""
    t, forces = profile(found)
    times = np.linspace(t[0], t[-1], 20 * len(t))
    sampled = [
        [np.interp(times, t, component) for component in contact]
        for contact in forces.transpose(1, 2, 0)
    ]
    change = np.linalg.norm(np.diff(sampled, axis=2), axis=1)
    return change.max() / (times[1] - times[0])


def jerk_limited(rate, mass=MASS, force=FORCE, length=LENGTH):
    """Least time of the carriage [s] where its force changes by at most that rate [N/s]."""
    rise = force / rate
    if 2.0 * rise**3 * rate / mass >= length:
        return (32.0 * length * mass / rate) ** (1.0 / 3.0)
    return rise + math.sqrt(rise**2 + 4.0 * length * mass / force)


@pytest.mark.parametrize("rate", [0.25, 1.0, 5.0])
def test_a_carriage_with_a_force_rate_is_limited_in_jerk(rate):
    # Both fingers take part: the force that moves the carriage changes at twice the rate.
    exact = jerk_limited(2.0 * rate)
    coarse, fine = (
        abs(solve_path(replace(carriage(n), force_rate=rate)).duration / exact - 1.0)
        for n in (41, 161)
    )
    # Of the first order in the time of the first interval, which starts at rest.
    assert fine < 0.006
    assert fine < 0.6 * coarse
    assert jerk_limited(2.0 * rate) > 1.1 * jerk_limited(1e9)


def test_a_force_rate_that_binds_is_kept_and_takes_longer(box, quick, gentle):
    assert steepest(quick) > 3.0 * RATE
    assert steepest(gentle) == pytest.approx(RATE, rel=0.01)
    assert 1.02 * quick.duration < gentle.duration < 1.2 * quick.duration
    assert gentle.residuals.primal < 1e-6
    assert gentle.residuals.gap < 1e-7
    shares = gentle.shares
    assert shares["force rate of left"].max() == pytest.approx(1.0, abs=1e-4)
    # The same forces, faster: caught by the solution's own check, too.
    assert replace(gentle, b=1.05 * gentle.b).residuals.primal > 0.02


def test_no_step_at_a_grid_point_or_at_the_start_is_larger_than_its_time_allows(gentle):
    count = len(gentle.times) - 1
    forces, steps = gentle.w_OC_C[0][..., :3], np.diff(gentle.times)
    starts, ends = forces[0 : 2 * count : 2], forces[1 : 2 * count : 2]
    jumps = np.linalg.norm(starts[1:] - ends[:-1], axis=2).max(axis=1)
    assert (jumps < 1.001 * RATE * (steps[1:] + steps[:-1]) / 2.0).all()
    for rest, motion, step in ((-2, starts[0], steps[0]), (-1, ends[-1], steps[-1])):
        assert np.linalg.norm(forces[rest] - motion, axis=1).max() < 1.001 * RATE * step / 2.0
        # It holds still: nothing accelerates there.
        assert gentle.motion[0][rest] == gentle.motion[1][rest] == 0.0
    assert gentle.imbalance < 1e-8


def test_repeated_solves_only_get_faster_and_each_keeps_the_limit(box, monkeypatch):
    every, settled = [], path_synthesizer._settled
    monkeypatch.setattr(
        path_synthesizer, "_settled", lambda *given: every.append(settled(*given)) or every[-1]
    )
    solve_path(replace(box, force_rate=10.0))
    limited = every[1:]
    assert len(limited) >= 3
    for before, after in pairwise(limited):
        # Both are solved to 1e-8.
        assert after.duration < before.duration * (1.0 + 1e-7)
        assert after.residuals.primal < 1e-6
    assert limited[-1].duration < 0.98 * limited[0].duration
    assert limited[-1].duration > 0.999 * limited[-2].duration


def test_a_loose_force_rate_gives_the_unlimited_plan(box, quick):
    found = solve_path(replace(box, force_rate=1e4))
    # Both are solved to 1e-9.
    assert found.duration == pytest.approx(quick.duration, rel=1e-7)
    assert max(s.max() for n, s in found.shares.items() if n.startswith("force rate")) < 0.5


def test_a_given_timing_is_limited_at_its_own_pace(box, quick, gentle):
    fields = {"objective": PathObjective.FRICTION_MARGIN, "force_rate": RATE}
    slow = solve_path(replace(box, timing=gentle.b / 4.0, **fields))
    assert steepest(slow) < 1.01 * RATE
    free = solve_path(replace(box, timing=gentle.b / 4.0, **fields | {"force_rate": None}))
    assert free.value < slow.value + 1e-4
    with pytest.raises(InfeasiblePathError, match="force rate of"):
        solve_path(replace(box, timing=quick.b, **fields))


def test_other_objectives_keep_a_force_rate(box, gentle):
    problem = replace(box, objective=PathObjective.LEAST_EFFORT, duration=2.0)
    free, found = solve_path(problem), solve_path(replace(problem, force_rate=RATE))
    assert steepest(found) < 1.01 * RATE < steepest(free)
    assert found.duration < 2.0 * (1.0 + 1e-6)
    assert free.value < found.value
    with pytest.raises(InfeasiblePathError, match="duration"):
        solve_path(replace(problem, force_rate=RATE, duration=0.98 * gentle.duration))


def test_a_rate_that_no_pace_keeps_is_infeasible_and_named():
    fast = carriage(51, start_rate=1.0, force_rate=0.05)
    with pytest.raises(InfeasiblePathError, match="force rate of") as caught:
        solve_path(fast)
    # The carriage would have to brake at once.
    assert caught.value.binding[0][1] < 0.1
    assert solve_path(replace(fast, force_rate=1.0)).residuals.primal < 1e-6


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf])
def test_a_senseless_force_rate_is_refused_by_name(rate):
    with pytest.raises(InvalidInputError, match=r"^force_rate"):
        carriage(force_rate=rate)
