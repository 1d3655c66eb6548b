"""Between the tilts that it is planned at, the robust grip serves the worlds it is meant for."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.model.grip import GripSchedule
from fulcrum.sim.planning import robust_grip as planning
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.scenario.control import controllers
from fulcrum.synthesis import Objective
from fulcrum.synthesis.robust import RobustInfeasibleError, robust_grip

# The hands of these cannot hold the object at all.
LIFTED = ("box-lift", "cylinder-lift")
NAMES = [name for name in scenarios() if name not in LIFTED]
# By so much may the interpolated grip be short, of what is computed anew there [N].
SHORT = 0.2


@cache
def prepared(name):
    """The scene, its robust control, its planned grip, and its problems with that grip."""
    scene = scenario(name)
    control = controllers(scene.control)["robust"]
    path = PathProblems(scene, control).joint_path
    grip = planning.plan_grip(scene, control, path)
    full = replace(control, friction_factor=1.0, objective=Objective.NORM_NORMAL_FORCE)
    return scene, control, path, grip, full


def between(name, count):
    """Tilts that are drawn [rad], and those half way between the coarse grid's [rad]."""
    end = prepared(name)[3].tilts[-1]
    drawn = np.random.default_rng(NAMES.index(name)).uniform(0.0, end, count)
    return [*drawn.tolist(), *np.radians([7.5, 27.5]), 0.98 * end]


def share_at(grip, tilt):
    """The share that interpolation is held to: the smaller of the neighbours'."""
    k = int(np.clip(np.searchsorted(grip.tilts, tilt), 1, len(grip.tilts) - 1))
    return float(grip.shares[k - 1 : k + 1].min())


def shortage(name, grip):
    """By how much the interpolated grip is less than the computed one, at worst [N]."""
    scene, control, path, _, full = prepared(name)
    problems, worst = PathProblems(scene, full, joint_path=path), 0.0
    for tilt in between(name, 12):
        share, tilt_deg = share_at(grip, tilt), float(np.degrees(tilt))
        at = problems.problem(tilt_deg), problems.gravity(tilt_deg)
        f_n = planning._serving(*at, control, share)
        worst = max(worst, float((f_n - grip.at(np.array([tilt]))[0]).max()))
    return worst


@pytest.mark.parametrize("name", NAMES)
def test_the_interpolated_grip_is_the_computed_one(name):
    assert shortage(name, prepared(name)[3]) <= SHORT


@pytest.mark.parametrize("name", ["panda-box", "ur5-box"])
def test_a_grid_of_5_deg_alone_is_short(name, monkeypatch):
    monkeypatch.setattr(planning, "_FINEST_DEG", np.inf)
    scene, control, path, _, _ = prepared(name)
    assert shortage(name, planning.plan_grip(scene, control, path)) > 10.0


@pytest.mark.parametrize("name", NAMES)
def test_sampled_worlds_between_the_tilts_of_the_grid_are_served(name):
    scene, control, path, grip, full = prepared(name)
    problems = PathProblems(scene, full, joint_path=path, grip=grip)
    rng = np.random.default_rng(5)
    for tilt in between(name, 12):
        tilt_deg = float(np.degrees(tilt))
        problem, gravity = problems.problem(tilt_deg), problems.gravity(tilt_deg)
        assert_served(pinned(problem), gravity, control, share_at(grip, tilt), rng)


def test_worlds_beyond_the_grip_are_not_served():
    _, control, path, grip, full = prepared("panda-box")
    problems = PathProblems(scenario("panda-box"), full, joint_path=path, grip=grip)
    served, short = (pinned(problems.problem(88.0), factor) for factor in (1.0, 84.1 / 98.5))
    gravity, rng = problems.gravity(88.0), np.random.default_rng(5)
    assert_served(served, gravity, control, 1.0, rng)
    # What was interpolated over 5 deg.
    with pytest.raises(RobustInfeasibleError):
        assert_served(short, gravity, control, 1.0, rng)


def pinned(problem, factor=1.0):
    """The problem with hands that press as the schedule says, and hardly more."""
    contacts = tuple(
        replace(c, f_n_min=factor * c.f_n_min, f_n_max=min(1.02 * factor * c.f_n_min, c.f_n_max))
        if i in problem.hands
        else c
        for i, c in enumerate(problem.contacts)
    )
    return replace(problem, contacts=contacts)


def assert_served(problem, gravity, control, share, rng):
    """Asks for forces in drawn worlds, corners of smaller sets, and in all corners of the set."""
    uncertainty = control.robustness.uncertainty
    for part in rng.uniform(0.0, 1.0, 3):
        worlds = uncertainty.scaled(share * float(part)).worlds(problem, gravity)
        robust_grip([worlds[int(rng.integers(len(worlds)))]])
    robust_grip(uncertainty.scaled(share).worlds(problem, gravity))


def test_the_largest_grip_between_two_tilts_counts_what_lies_within():
    grip = GripSchedule(np.array([0.0, 1.0, 2.0]), np.array([[1.0], [5.0], [2.0]]), np.ones(3))
    assert grip.largest(0.5, 1.5) == pytest.approx([5.0])
    assert grip.largest(-1.0, 0.5) == pytest.approx([3.0])
    assert grip.largest(1.0, 3.0) == pytest.approx([5.0])
