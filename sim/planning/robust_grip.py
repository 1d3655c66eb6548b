"""Plans the grip of the robust controller: one grip that serves every world of a set.

At each tilt of a grid one robust counterpart of (17) is solved with the true friction. Where no
grip serves the whole set on top of the whole preload, the largest share of both that one serves
counts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fulcrum.sim.model.grip import GripSchedule, pressed
from fulcrum.sim.motion.joint_path import JointPath
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.synthesis import Objective, SolverError
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.problem import Gravity, Problem
from fulcrum.synthesis.robust.certificate import RobustInfeasibleError
from fulcrum.synthesis.robust.grip import robust_grip
from fulcrum.synthesis.robust.scaling import Scaling, largest_scaling

# Between these steps grip is interpolated; it bends by less than 1 % of its peak in one [deg].
_STEP_DEG = 5.0
# Shares are found to within two to the power of minus this.
_HALVINGS = 4


def plan_grip(
    scenario: Scenario, control: Control, joint_path: JointPath | None = None
) -> GripSchedule | None:
    """The least grip that gives the control its robustness; None if it asks for none.

    Args:
        scenario: The scene as it is believed.
        control: The controller.
        joint_path: The scenario's, where it is planned already.

    Raises:
        PathError: The arms cannot follow the path.
        RobustInfeasibleError: At a tilt no forces hold even the nominal object, and the control
            does not ask for the best effort.
        SolverError: The solver gave neither forces nor a proof.
    """
    if control.robustness is None:
        return None
    problems = _true_problems(scenario, control, joint_path)
    tilts_deg = problems.tilts(_STEP_DEG)
    found = [
        _grip(problems.problem(tilt), problems.gravity(tilt), control)
        for tilt in tilts_deg.tolist()
    ]
    return GripSchedule(
        tilts=np.radians(tilts_deg),
        f_n=np.array([f_n for f_n, _ in found]),
        shares=np.array([share for _, share in found]),
    )


def borne(
    scenario: Scenario, control: Control, step_deg: float, joint_path: JointPath | None = None
) -> dict[float, Scaling]:
    """How much of the set of a robust control one grip bears, by tilt [deg].

    Args:
        scenario: The scene as it is believed.
        control: The controller.
        step_deg: Largest step between tilts [deg].
        joint_path: The scenario's, where it is planned already.

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
    scenario: Scenario, control: Control, joint_path: JointPath | None
) -> PathProblems:
    """The problems with the believed friction in full: the set says how much less it may be."""
    # The norm makes the forces of unequal hands unique.
    full = replace(control, friction_factor=1.0, objective=Objective.NORM_NORMAL_FORCE)
    return PathProblems(scenario, full, joint_path=joint_path)


def _grip(problem: Problem, gravity: Gravity, control: Control) -> tuple[Array, float]:
    """Normal forces of the hands [N], (n,), and the share of the robustness that they give."""
    assert control.robustness is not None
    robustness = control.robustness

    def serving(share: float) -> Array:
        least = problem.contact_set.preload
        preload = max(least, least + share * (robustness.preload - least))
        hands = np.full(len(problem.hands), preload)
        squeezed = replace(problem, contacts=pressed(problem.contacts, hands))
        return robust_grip(robustness.uncertainty.scaled(share).worlds(squeezed, gravity)).f_n

    try:
        return serving(1.0), 1.0
    except (RobustInfeasibleError, SolverError):
        share = 0.0
    try:
        f_n = serving(share)
    except RobustInfeasibleError:
        if not control.best_effort:
            raise
        return np.full(len(problem.hands), control.preload), share
    for step in 0.5 ** np.arange(1, _HALVINGS + 1):
        try:
            f_n = serving(share + step)
        except (RobustInfeasibleError, SolverError):
            continue
        share += float(step)
    return f_n, share
