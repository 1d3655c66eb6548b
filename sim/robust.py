"""Plans the grip of the robust controller: one grip that serves every world of a set.

At each tilt of a grid one robust counterpart of (17) is solved with the true friction; where no
grip serves the whole set, the largest share of it that one does serve counts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim.grip import GripSchedule
from sim.ik import JointPath
from sim.poses import PathProblems
from sim.scenario import Scenario
from sim.settings import Control
from synthesis import Objective, RobustInfeasibleError, SolverError
from synthesis.contact import Array
from synthesis.robust import robust_grip
from synthesis.scaling import largest_scaling
from synthesis.uncertainty_set import UncertaintySet

# Between these steps grip is interpolated; it bends by less than 1 % of its peak in one [deg].
_STEP_DEG = 2.5


def plan_grip(
    scenario: Scenario, control: Control, joint_path: JointPath | None = None
) -> GripSchedule:
    """The least grip that serves the control's uncertainty set, and no less than its preload.

    Args:
        scenario: The scene as it is believed.
        control: The controller.
        joint_path: The scenario's, where it is planned already.

    Raises:
        PathError: The arms cannot follow the path.
        RobustInfeasibleError: At a tilt no forces hold even the nominal object.
        SolverError: The solver gave neither forces nor a proof.
    """
    uncertainty = control.uncertainty or UncertaintySet()
    # The set says how much less the friction may be than believed.
    # The norm makes the forces of unequal hands unique.
    true = replace(control, friction_factor=1.0, objective=Objective.NORM_NORMAL_FORCE)
    problems = PathProblems(scenario, true, joint_path=joint_path)
    tilts_deg = problems.tilts(_STEP_DEG)
    found = [_grip(problems, float(tilt), uncertainty) for tilt in tilts_deg]
    return GripSchedule(
        tilts=np.radians(tilts_deg),
        f_n=np.array([f_n for f_n, _ in found]),
        shares=np.array([share for _, share in found]),
    )


def _grip(
    problems: PathProblems, tilt_deg: float, uncertainty: UncertaintySet
) -> tuple[Array, float]:
    problem, gravity = problems.problem(tilt_deg), problems.gravity(tilt_deg)
    try:
        return robust_grip(uncertainty.worlds(problem, gravity)).f_n, 1.0
    except (RobustInfeasibleError, SolverError):
        scaling = largest_scaling(problem, gravity, uncertainty, most=1.0)
        return scaling.grip.f_n, scaling.factor
