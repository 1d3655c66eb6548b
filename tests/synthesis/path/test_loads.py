from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.planning.problem import path_problem
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.path import loads as path_loads
from fulcrum.synthesis.path.forces import GivenMotion
from fulcrum.synthesis.path.loads import solve_many
from fulcrum.synthesis.path.problem import PathObjective
from fulcrum.synthesis.path.solution import InfeasiblePathError
from fulcrum.synthesis.path.synthesizer import solve_path
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
from tests.helpers.plans import BOX, MARGINS

SET = UncertaintySet(mass=0.2, center=(0.02, 0.0, 0.02), friction=0.2)


@pytest.fixture(scope="module")
def uncertain():
    """The box with nine loads."""
    return path_problem(scenario(BOX), MARGINS[BOX], 45, SET)[0]


@pytest.fixture(scope="module")
def together(uncertain):
    return solve_path(uncertain)


def test_few_loads_at_a_time_give_what_all_at_once_give(uncertain, together, monkeypatch):
    counts = []
    monkeypatch.setattr(
        path_loads, "solve_path", lambda p: counts.append((len(p.s), len(p.loads))) or solve_path(p)
    )
    found = solve_many(uncertain)
    # Both are solved to 1e-9.
    assert found.duration == pytest.approx(together.duration, rel=1e-7)
    assert len(found.w_OC_C) == len(uncertain.loads) == 9
    assert found.residuals.primal < 1e-6
    assert found.residuals.gap < 1e-8
    # All of them on the coarse grid alone.
    assert [loads for points, loads in counts if points == 45][-1] < 5
    first = solve_path(replace(uncertain, loads=uncertain.loads[:1]))
    assert first.duration < 0.999 * found.duration


def test_so_they_do_where_friction_is_what_counts(uncertain, together):
    timed = replace(uncertain, timing=together.b / 2.25, objective=PathObjective.FRICTION_MARGIN)
    found, whole = solve_many(timed), solve_path(timed)
    # The margin is sought until a solve gains less than 1e-4.
    assert found.value == pytest.approx(whole.value, abs=3e-4)
    assert max(u.max() for u in found.utilisation) < found.value + 1e-6
    alone = solve_many(replace(timed, loads=timed.loads[:1]))
    assert alone.value < 0.95 * found.value


def test_a_load_that_no_grip_serves_is_infeasible(uncertain):
    heavy = uncertain.loads[-1]
    twice = tuple(replace(p, w_ext_O=2.0 * p.w_ext_O) for p in heavy.problems)
    loads = (*uncertain.loads, replace(heavy, problems=twice))
    with pytest.raises(InfeasiblePathError):
        solve_many(replace(uncertain, loads=loads))


# --- a load in a given motion


def test_forces_with_another_load_are_made_from_known_ones_or_sought(uncertain, together):
    grip = together.w_OC_C[0][:, :2, N]
    motion = GivenMotion(uncertain, together.b, grip, 1.0)
    served = replace(together, iterations=0)
    for i, load in enumerate(uncertain.loads[1:], start=1):
        lacking, forces = motion.forces(load, [together.w_OC_C[0]])
        assert lacking < 1e-7
        assert forces[:, :2, N] == pytest.approx(grip, rel=1e-9)
        w_OC_C = list(served.w_OC_C)
        w_OC_C[i] = forces
        served = replace(served, w_OC_C=tuple(w_OC_C))
    # The solution's own check, in other code.
    assert served.residuals.primal < 1e-6
    # Some stations went to the solver, and not all.
    assert motion.iterations > 0


def test_how_much_friction_a_load_lacks_is_said(uncertain, together):
    grip = together.w_OC_C[0][:, :2, N]
    motion = GivenMotion(uncertain, together.b, grip, 1.0)
    heavy = uncertain.loads[-1]
    lacking = []
    for share in (1.0, 1.05, 1.1):
        problems = tuple(replace(p, w_ext_O=share * p.w_ext_O) for p in heavy.problems)
        lacking.append(motion.forces(replace(heavy, problems=problems), [together.w_OC_C[-1]])[0])
    assert lacking[0] < 1e-7
    assert 1e-4 < lacking[1] < lacking[2]
    # With half the grip everything lacks more.
    weak = GivenMotion(uncertain, together.b, 0.5 * grip, 1.0)
    assert weak.forces(heavy, [0.5 * together.w_OC_C[-1]])[0] > 0.01


def test_a_path_on_fewer_points_is_the_same_path(uncertain):
    points = np.array([0, 11, 22, 33, 44])
    coarse = uncertain.at(points)
    own = path_problem(scenario(BOX), MARGINS[BOX], 5, SET)[0]
    np.testing.assert_allclose(coarse.s, own.s, atol=1e-12)
    np.testing.assert_allclose(coarse.loads[3].w_b_O, own.loads[3].w_b_O, atol=1e-9)
    np.testing.assert_allclose(coarse.rates.slopes, own.rates.slopes, atol=1e-9)
    np.testing.assert_allclose(coarse.inertial_torques.tau_a, own.inertial_torques.tau_a, atol=1e-9)
