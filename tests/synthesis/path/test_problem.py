import math
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import InfeasibleError, InvalidInputError, Objective, Synthesizer
from fulcrum.synthesis.errors import UnboundedError
from fulcrum.synthesis.path.limits import Accelerations
from fulcrum.synthesis.path.problem import InertialTorques, Load, PathObjective, PathProblem
from fulcrum.synthesis.path.solution import InfeasiblePathError
from fulcrum.synthesis.path.synthesizer import solve_path
from tests.helpers import problems
from tests.helpers.paths import FORCE, LENGTH, MASS, bang_bang, bang_bang_damped, carriage

LIMIT = 40.0


def resting(problem, objective):
    """A path of a single point."""
    l = 0 if problem.joints is None else len(problem.joints.names)
    torques = InertialTorques(*np.ones((3, 1, l))) if l else None
    load = Load((problem,), np.ones((1, 6)), np.ones((1, 6)))
    return PathProblem(np.zeros(1), (load,), torques, objective=objective)


def held(tilt, objective=Objective.NORM_TORQUE, mu=1.0):
    """The box in random arms whose joints are all equally strong, with a preload."""
    arms = problems.arms()
    limit = np.full(len(arms.names), LIMIT)
    problem = problems.box(tilt, joints=replace(arms, tau_min=-limit, tau_max=limit))
    contacts = [
        replace(c, mu=mu * c.mu, f_n_min=5.0 * (i < 2), f_n_max=60.0)
        for i, c in enumerate(problem.contacts)
    ]
    return replace(problem, contacts=tuple(contacts), objective=objective)


# --- one point at rest is (17)


@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0, 85.0])
def test_least_effort_at_one_point_is_the_norm_of_the_torques_in_17(tilt):
    problem = held(tilt)
    there = Synthesizer().solve(problem)
    here = solve_path(resting(problem, PathObjective.LEAST_EFFORT))
    # Both are solved to 1e-9, and torques of 40 N m are squared.
    assert here.value == pytest.approx((there.value / LIMIT) ** 2, rel=1e-6)
    assert here.tau[0][0] == pytest.approx(there.tau, abs=1e-3)


@pytest.mark.parametrize("tilt", [0.0, 30.0, 85.0])
def test_the_friction_margin_at_one_point_is_that_of_17(tilt):
    problem = held(tilt, Objective.FRICTION_MARGIN)
    there = Synthesizer().solve(problem).value
    here = solve_path(resting(problem, PathObjective.FRICTION_MARGIN)).value
    assert 0.1 < there < 1.0
    # The path's margin is sought until a solve gains less than 1e-4.
    assert here == pytest.approx(there, abs=1e-4)


def test_one_point_is_infeasible_where_17_is():
    problem = held(0.0, mu=0.3)
    with pytest.raises(InfeasibleError):
        Synthesizer().solve(problem)
    with pytest.raises(InfeasiblePathError):
        solve_path(resting(problem, PathObjective.LEAST_TIME))


def test_one_point_with_forces_takes_no_time():
    found = solve_path(resting(held(0.0), PathObjective.LEAST_TIME))
    assert found.duration == 0.0
    assert found.residuals.primal < 1e-8


# --- answers that are known


@pytest.mark.parametrize("robot", [0.0, 1.3])
def test_least_time_of_a_carriage_is_bang_bang(robot):
    found = solve_path(carriage(robot=robot))
    # The switch is at a grid point, so that the grid costs nothing.
    assert found.duration == pytest.approx(bang_bang(MASS + robot), rel=1e-7)
    assert found.value == pytest.approx(found.duration, rel=1e-7)
    assert np.abs(found.tau[0]) == pytest.approx(FORCE, rel=1e-5)
    assert np.sign(found.a).tolist() == [1.0] * 50 + [-1.0] * 50


def test_a_speed_limit_cuts_the_top_off():
    acceleration = FORCE / MASS
    # Reached after a quarter of the way, at a grid point.
    speed = math.sqrt(2.0 * acceleration * LENGTH / 4.0)
    found = solve_path(carriage(speed=speed))
    assert found.duration == pytest.approx(LENGTH / speed + speed / acceleration, rel=1e-7)
    assert found.shares["speed of slide"].max() == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize("damping", [1.5, 4.0])
def test_viscous_friction_counts_with_the_exact_rate(damping):
    coarse, fine = (solve_path(carriage(points, damping=damping)) for points in (51, 401))
    exact = bang_bang_damped(MASS, damping)
    # An acceleration that is constant in an interval wastes force where friction grows in it: the
    # answer comes down to the exact one, from the safe side.
    assert exact < fine.duration < 1.01 * exact
    assert fine.duration < coarse.duration
    assert bang_bang(MASS) < 0.97 * exact
    assert fine.residuals.primal < 1e-6


def test_the_unit_of_the_path_coordinate_does_not_matter():
    own, factor = carriage(robot=1.0, damping=0.5, speed=1.2), 90.0
    torques, load = own.inertial_torques, own.loads[0]
    other = replace(
        own,
        s=factor * own.s,
        loads=(replace(load, w_a_O=load.w_a_O / factor, w_b_O=load.w_b_O / factor**2),),
        inertial_torques=InertialTorques(
            torques.tau_a / factor, torques.tau_b / factor**2, torques.tau_c / factor
        ),
        rates=replace(own.rates, slopes=own.rates.slopes / factor),
    )
    assert solve_path(other).duration == pytest.approx(solve_path(own).duration, rel=1e-7)


def test_an_acceleration_limit_holds():
    limited = Accelerations(
        ("tip",),
        np.tile([[LENGTH, 0.0, 0.0]], (101, 1, 1)),
        np.zeros((101, 1, 3)),
        np.array([0.5]),
    )
    found = solve_path(carriage(accelerations=limited))
    assert found.duration == pytest.approx(bang_bang(1.0, force=0.5), rel=1e-7)
    assert found.active()[0] == ("acceleration of tip",)


def test_a_moving_start_is_faster():
    still = solve_path(carriage()).duration
    # Half the way at the speed that force gives after the first half.
    top = math.sqrt(FORCE / MASS / LENGTH)
    found = solve_path(carriage(start_rate=top))
    assert found.duration < 0.75 * still
    assert math.sqrt(found.b[0]) == pytest.approx(top)


def test_least_effort_takes_all_the_time_and_falls_with_its_fourth_power():
    quick, slow = (
        solve_path(carriage(objective=PathObjective.LEAST_EFFORT, duration=duration))
        for duration in (4.0, 8.0)
    )
    # The gap of both solves is 1e-9; the effort itself is a squared force of 1/16 of the limit.
    assert quick.duration == pytest.approx(4.0, rel=1e-5)
    assert slow.duration == pytest.approx(8.0, rel=1e-5)
    assert slow.value == pytest.approx(quick.value / 16.0, rel=1e-5)
    # Bang-bang in the same time, forces of a constant size, costs more.
    assert quick.value < 0.99 * (bang_bang(MASS) / 4.0) ** 4


def test_two_loads_share_the_grip_and_nothing_else():
    light, heavy = (
        resting(replace(held(20.0), w_ext_O=share * held(20.0).w_ext_O), PathObjective.LEAST_EFFORT)
        for share in (0.8, 1.2)
    )
    both = solve_path(replace(light, loads=(*light.loads, *heavy.loads)))
    first, second = both.w_OC_C
    assert first[0, :2, 2] == pytest.approx(second[0, :2, 2], abs=0.0)
    assert np.abs(first[0, 2:, 2] - second[0, 2:, 2]).max() > 1.0
    assert both.residuals.primal < 1e-8
    alone = [solve_path(problem) for problem in (light, heavy)]
    # The mean effort of both, for which each alone would choose a grip of its own.
    assert both.value > 1.001 * np.mean([found.value for found in alone])
    assert abs(alone[0].w_OC_C[0][0, 0, 2] - alone[1].w_OC_C[0][0, 0, 2]) > 0.1


# --- what is refused, and what is proven


def test_a_duration_below_the_least_time_is_infeasible_and_named():
    least = bang_bang(MASS)
    fields = {"objective": PathObjective.LEAST_EFFORT}
    assert solve_path(carriage(duration=1.01 * least, **fields)).duration < 1.0101 * least
    with pytest.raises(InfeasiblePathError, match="duration") as caught:
        solve_path(carriage(duration=0.99 * least, **fields))
    assert "torque of slide" in [name for name, _ in caught.value.binding]


def test_a_friction_margin_without_bound_of_grip_is_unbounded():
    unlimited = resting(problems.box(30.0), PathObjective.FRICTION_MARGIN)
    with pytest.raises(UnboundedError, match="f_n_max"):
        solve_path(unlimited)


def test_residuals_catch_a_timing_that_forces_do_not_fit():
    found = solve_path(carriage())
    assert found.residuals.primal < 1e-7
    assert found.residuals.dual < 1e-7
    assert found.residuals.gap < 1e-7
    hasty = replace(found, b=1.02 * found.b)
    assert hasty.residuals.primal > 0.01


def test_forces_for_a_given_timing_keep_it():
    timing = solve_path(carriage(robot=1.0)).b / 4.0
    problem = carriage(robot=1.0, objective=PathObjective.LEAST_EFFORT, timing=timing)
    found = solve_path(problem)
    assert found.duration == pytest.approx(2.0 * bang_bang(MASS + 1.0), rel=1e-6)
    assert np.abs(found.tau[0]) == pytest.approx(FORCE / 4.0, rel=1e-5)
    with pytest.raises(InfeasiblePathError):
        solve_path(replace(problem, timing=4.1 * timing))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"s": np.zeros(101)}, "s"),
        ({"s": np.full(101, np.nan)}, "s"),
        ({"loads": ()}, "loads"),
        ({"start_rate": -1.0}, "start_rate"),
        ({"end_rate": math.inf}, "end_rate"),
        ({"duration": 0.0}, "duration"),
        ({"inertial_torques": None}, "inertial_torques"),
        ({"objective": PathObjective.LEAST_EFFORT}, "duration"),
        ({"objective": PathObjective.FRICTION_MARGIN, "duration": 1.0}, "contacts"),
        ({"timing": np.zeros(101)}, "timing"),
        ({"timing": np.ones(101)}, "objective"),
    ],
)
def test_senseless_fields_are_refused_by_name(change, field):
    with pytest.raises(InvalidInputError, match=f"^{field}"):
        replace(carriage(), **change)


def test_loads_of_other_shape_or_structure_are_refused():
    load = carriage().loads[0]
    with pytest.raises(InvalidInputError, match=r"load\.w_a_O"):
        replace(load, w_a_O=np.zeros((100, 6)))
    contacts = tuple(replace(c, f_n_max=50.0) for c in load.problems[0].contacts)
    other = replace(load.problems[0], contacts=contacts)
    with pytest.raises(InvalidInputError, match=r"load\.problems\[100\]"):
        replace(load, problems=(*load.problems[:-1], other))
