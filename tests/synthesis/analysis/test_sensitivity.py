"""Sensitivities from the duals against central differences of the re-solved problem."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.synthesis import Objective, Synthesizer
from fulcrum.synthesis.analysis.sensitivity import sensitivities
from fulcrum.synthesis.problem import Gravity
from tests.helpers.problems import arms, box, cylinder

SYNTHESIZER = Synthesizer()
# Relative; differences leave h^2 of the curvature (h is 1e-4 of a parameter) and the solver's 1e-9
# over h, each a tenth of this at most.
AGREEMENT = 1e-4
# Slopes that change the objective by less than this share of it per 100 % are compared on that
# scale: the solver's noise over the step.
FLOOR = 5e-2
# Centre of mass [m].
CENTER_STEP = 1e-5


@cache
def path_problems():
    box_tilt = scenario("box-tilt")
    return PathProblems(box_tilt, box_tilt.control)


def baxter(tilt_deg, objective=Objective.MAX_NORMAL_FORCE, torque=1.0, f_n_min=5.0):
    problem = path_problems().problem(tilt_deg)
    joints = problem.joints
    contacts = tuple(
        replace(c, f_n_min=f_n_min) if i in problem.hands else c
        for i, c in enumerate(problem.contacts)
    )
    limited = replace(joints, tau_min=torque * joints.tau_min, tau_max=torque * joints.tau_max)
    return replace(problem, contacts=contacts, joints=limited, objective=objective)


def weight_of(problem, center_O=(0.0, 0.0, 0.0)):
    """The weight of a problem without other external forces."""
    weight = float(np.linalg.norm(problem.w_ext_O[:3]))
    return Gravity(weight, problem.w_ext_O[:3] / weight, np.array(center_O))


def with_gravity(problem, before, after):
    return replace(problem, w_ext_O=problem.w_ext_O - before.wrench_O + after.wrench_O)


def with_contact(problem, index, **fields):
    contacts = list(problem.contacts)
    contacts[index] = replace(contacts[index], **fields)
    return replace(problem, contacts=tuple(contacts))


def with_limit(problem, field, index, limit):
    limits = getattr(problem.joints, field).copy()
    limits[index] = limit
    return replace(problem, joints=replace(problem.joints, **{field: limits}))


def parameters(problem, gravity):
    """(name, value, step, problem by value) of all that has a sensitivity."""

    def heavier(weight):
        return with_gravity(problem, gravity, replace(gravity, weight=weight))

    yield "weight", gravity.weight, heavier
    for axis in range(3):

        def moved(at, axis=axis):
            center_O = gravity.center_O.copy()
            center_O[axis] = at
            return with_gravity(problem, gravity, replace(gravity, center_O=center_O))

        yield f"center {axis}", gravity.center_O[axis], moved
    for i, c in enumerate(problem.contacts):
        for field in ("mu", "f_n_min", "f_n_max"):
            if 0.0 < getattr(c, field) < np.inf:
                yield (
                    f"{field} {c.name}",
                    getattr(c, field),
                    lambda v, i=i, field=field: with_contact(problem, i, **{field: v}),
                )
    for k, name in enumerate(problem.joints.names if problem.joints else ()):
        for field in ("tau_min", "tau_max"):
            yield (
                f"{field} {name}",
                getattr(problem.joints, field)[k],
                lambda v, k=k, field=field: with_limit(problem, field, k, v),
            )


def flat(found):
    named = {"weight": found.weight}
    named |= {f"center {axis}": slope for axis, slope in enumerate(found.center_of_mass)}
    named |= {f"mu {name}": slope for name, slope in found.friction.items()}
    for field in ("f_n_min", "f_n_max", "tau_min", "tau_max"):
        named |= {f"{field} {name}": slope for name, slope in getattr(found, field).items()}
    return named


def deviations(problem, gravity, found):
    """Relative deviation of each sensitivity from the central difference."""
    value = SYNTHESIZER.solve(problem).value
    result = {}
    for name, at, changed in parameters(problem, gravity):
        center = name.startswith("center")
        h = CENTER_STEP if center else 1e-4 * abs(at)
        up, down = (SYNTHESIZER.solve(changed(at + s * h)).value for s in (1.0, -1.0))
        expected = (up - down) / (2.0 * h)
        floor = FLOOR * abs(value) / (0.1 if center else abs(at))
        result[name] = abs(flat(found)[name] - expected) / max(abs(expected), floor)
    return result


def found_for(problem, gravity):
    return sensitivities(SYNTHESIZER.solve(problem), gravity)


PLAIN = {
    **{f"box {tilt:g}": box(tilt) for tilt in (10.0, 40.0, 80.0)},
    **{f"cylinder {tilt:g}": cylinder(tilt) for tilt in (10.0, 40.0, 80.0)},
    "cylinder margin": replace(cylinder(40.0), objective=Objective.FRICTION_MARGIN),
}


@pytest.mark.parametrize("problem", PLAIN.values(), ids=PLAIN)
def test_sensitivities_without_joints_are_the_differences(problem):
    gravity = weight_of(problem)
    worst = deviations(problem, gravity, found_for(problem, gravity))
    assert max(worst.values()) < AGREEMENT, worst


@pytest.mark.parametrize("objective", Objective)
@pytest.mark.parametrize("tilt", [10.0, 40.0])
def test_sensitivities_with_baxter_s_joints_are_the_differences(objective, tilt):
    problem = baxter(tilt, objective)
    gravity = weight_of(problem)
    worst = deviations(problem, gravity, found_for(problem, gravity))
    assert max(worst.values()) < AGREEMENT, worst


def test_sensitivities_of_an_eccentric_weight_are_the_differences():
    problem = box(30.0, joints=arms(), objective=Objective.NORM_TORQUE)
    gravity = weight_of(problem, (0.02, -0.01, 0.03))
    eccentric = with_gravity(problem, weight_of(problem), gravity)
    worst = deviations(eccentric, gravity, found_for(eccentric, gravity))
    assert max(worst.values()) < AGREEMENT, worst


def test_active_torque_limits_have_their_sensitivity():
    # Just above the least torque limits that do, 0.619 times Baxter's, they bend the optimum.
    problem = baxter(0.0, torque=0.625)
    gravity = weight_of(problem)
    found = found_for(problem, gravity)
    assert max(abs(s) for s in (*found.tau_min.values(), *found.tau_max.values())) > 0.1
    worst = deviations(problem, gravity, found)
    assert max(worst.values()) < AGREEMENT, worst


def test_active_preload_has_its_sensitivity():
    problem = baxter(70.0, Objective.NORM_NORMAL_FORCE, f_n_min=20.0)
    gravity = weight_of(problem)
    found = found_for(problem, gravity)
    assert found.f_n_min["left"] > 0.1
    worst = deviations(problem, gravity, found)
    assert max(worst.values()) < AGREEMENT, worst


def test_active_grip_limit_has_its_sensitivity():
    problem = PLAIN["cylinder margin"]
    found = found_for(problem, weight_of(problem))
    # More grip, less of the friction used.
    assert min(found.f_n_max.values()) < -1e-3


@pytest.mark.parametrize("field", ["equilibrium", "cone"])
def test_sensitivities_from_tampered_multipliers_are_noticed(field):
    solution = SYNTHESIZER.solve(box(40.0))
    gravity = weight_of(solution.problem)
    tampered = replace(solution.multipliers, **{field: 1.01 * getattr(solution.multipliers, field)})
    found = sensitivities(replace(solution, unpack=lambda: tampered), gravity)
    assert max(deviations(solution.problem, gravity, found).values()) > 10.0 * AGREEMENT


def test_grip_without_preload_is_proportional_to_the_weight():
    solution = SYNTHESIZER.solve(box(40.0))
    gravity = weight_of(solution.problem)
    slope = sensitivities(solution, gravity).weight
    # The problem is homogeneous; the solver's tolerance is left.
    assert slope * gravity.weight == pytest.approx(solution.value, rel=1e-7)
