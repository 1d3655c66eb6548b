"""Planning of the robust controller's grip: one grip that serves every world of a set.

At each tilt of a grid one robust counterpart of (17) is solved with the true friction. Where no
grip serves the whole set and the whole preload, the grip serves the largest possible share of
both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fulcrum.sim.model import GripSchedule, RobotModel, pressed
from fulcrum.sim.motion import JointPath
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis import Objective, Problem, SolverError
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.robust import RobustInfeasibleError, Scaling, largest_scaling, robust_grip

# Coarsest and finest step of the grid of tilts [deg]. The finest is less than the step for which
# :mod:`fulcrum.sim.model.statics` prepares contacts.
_STEP_DEG, _FINEST_DEG = 5.0, 0.3
# Largest deficit and largest excess of the interpolated grip against the computed one half way
# between two points [N].
_SHORT, _OVER = 0.05, 0.5
# Number of bisections of a share, which is accurate to 2^-n.
_HALVINGS = 4
# Tilt [deg], normal forces of the hands [N], (n,), share of the robustness that they give [-].
_Point = tuple[float, Array, float]


def plan_grip(
    scenario: Scenario,
    control: Control,
    joint_path: JointPath | None = None,
    robot: RobotModel | None = None,
    best_effort: bool = False,
) -> GripSchedule | None:
    """Return the least grip for a control's robustness; None for a control without it.

    Args:
        scenario: The nominal scene.
        control: Settings of the controller.
        joint_path: Joint path of the scenario; planned if left out.
        robot: Model of the scenario's robots; built if left out.
        best_effort: Whether to use the control's preload where no forces hold the object.

    Raises:
        PathError: The arms cannot follow the path.
        RobustInfeasibleError: At a tilt no forces hold even the nominal object, without
            `best_effort`.
        SolverError: The solver gave neither forces nor a proof.
    """
    if control.robustness is None:
        return None
    problems = _true_problems(scenario, control, joint_path, robot)

    def at(tilt_deg: float, share: float | None = None) -> _Point:
        problem, gravity = problems.problem(tilt_deg), problems.gravity(tilt_deg)
        if share is not None:
            try:
                return tilt_deg, _serving(problem, gravity, control, share), share
            except (RobustInfeasibleError, SolverError):
                pass
        return tilt_deg, *_grip(problem, gravity, control, best_effort)

    coarse = [at(tilt) for tilt in problems.tilts(_STEP_DEG).tolist()]
    points = [coarse[0]]
    for before, after in pairwise(coarse):
        points += [*_between(at, before, after), after]
    tilts_deg, f_n, shares = zip(*points, strict=True)
    return GripSchedule(np.radians(tilts_deg), np.array(f_n), np.array(shares), least=True)


def _between(at: Callable[[float, float], _Point], before: _Point, after: _Point) -> list[_Point]:
    """Return the points to add between two, until interpolation agrees with the grip half way.

    The grip half way is that for the smaller of the two shares, if there is one: shares are steps
    of a bisection, and the grip jumps from one share to the next.
    """
    if after[0] - before[0] < 2.0 * _FINEST_DEG:
        return []
    share = min(before[2], after[2])
    middle = at(0.5 * (before[0] + after[0]), share)
    lacking = middle[1] - 0.5 * (before[1] + after[1])
    smooth = lacking.max() <= _SHORT and (lacking.min() >= -_OVER or before[2] != after[2])
    if smooth and middle[2] >= share:
        return []
    return [*_between(at, before, middle), middle, *_between(at, middle, after)]


def borne(
    scenario: Scenario, control: Control, step_deg: float, joint_path: JointPath | None = None
) -> dict[float, Scaling]:
    """Return by tilt [deg] the largest scaling of a robust control's set that one grip withstands.

    Args:
        scenario: The nominal scene.
        control: Settings of the controller, with robustness.
        step_deg: Largest step between tilts [deg].
        joint_path: Joint path of the scenario; planned if left out.

    Raises:
        PathError: The arms cannot follow the path.
        RobustInfeasibleError: At a tilt no forces hold even the nominal object.
    """
    assert control.robustness is not None
    problems = _true_problems(scenario, control, joint_path)
    return {
        tilt: largest_scaling(
            problems.problem(tilt), problems.gravity(tilt), control.robustness.uncertainty
        )
        for tilt in problems.tilts(step_deg).tolist()
    }


def _true_problems(
    scenario: Scenario,
    control: Control,
    joint_path: JointPath | None,
    robot: RobotModel | None = None,
) -> PathProblems:
    """Return the problems with the full nominal friction; the set contains its reductions."""
    # The norm makes the forces of unequal hands unique.
    full = replace(control, friction_factor=1.0, objective=Objective.NORM_NORMAL_FORCE)
    return PathProblems(scenario, full, joint_path=joint_path, robot=robot)


def _serving(problem: Problem, gravity: Gravity, control: Control, share: float) -> Array:
    """Return normal forces of the hands [N], (n,), that give a share of the robustness.

    Raises:
        RobustInfeasibleError: There are none.
        SolverError: The solver gave neither forces nor a proof.
    """
    assert control.robustness is not None
    least, robustness = problem.contact_set.preload, control.robustness
    preload = max(least, least + share * (robustness.preload - least))
    hands = np.full(len(problem.hands), preload)
    squeezed = replace(problem, contacts=pressed(problem.contacts, hands))
    return robust_grip(robustness.uncertainty.scaled(share).worlds(squeezed, gravity)).f_n


def _grip(
    problem: Problem, gravity: Gravity, control: Control, best_effort: bool
) -> tuple[Array, float]:
    """Return normal forces of the hands [N], (n,), and their share of the robustness [-]."""

    def serving(share: float) -> Array:
        return _serving(problem, gravity, control, share)

    try:
        return serving(1.0), 1.0
    except (RobustInfeasibleError, SolverError):
        share = 0.0
    try:
        f_n = serving(share)
    except RobustInfeasibleError:
        if not best_effort:
            raise
        return np.full(len(problem.hands), control.preload), share
    for step in 0.5 ** np.arange(1, _HALVINGS + 1):
        try:
            f_n = serving(share + step)
        except (RobustInfeasibleError, SolverError):
            continue
        share += float(step)
    return f_n, share
