"""Preparation of a run: plans, and checks that refuse an infeasible scenario before it moves."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.sim.analysis import Explanation
from fulcrum.sim.analysis.explain import explain
from fulcrum.sim.model import GripSchedule, RobotModel
from fulcrum.sim.motion import JointPath, plan_joints
from fulcrum.sim.planning import Execution, PathProblems, Planning, plan_grip, planned_tilt
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis import (
    FulcrumError,
    InfeasibleError,
    SolverError,
    Synthesizer,
    UnboundedError,
)

# Step of the tilt at which the path is checked for forces [deg].
_CHECK_DEG = 5.0


class UnholdableError(FulcrumError):
    """No forces hold the object somewhere on the path; nothing has moved."""

    def __init__(self, explanation: Explanation) -> None:
        self.explanation = explanation
        super().__init__(
            f"{explanation.scenario} cannot be held at {explanation.tilt_deg:g} deg: "
            f"{explanation.conflict.sentence if explanation.conflict else ''}."
        )


@dataclass(frozen=True, eq=False)
class Preparation:
    """The plans of a run; runs in different worlds can share them.

    They depend only on the controller and the scenario that it assumes.

    Attributes:
        robot: Model of the robots that the controller uses.
        joint_path: Joint path with which the arms follow the object's path.
        grip: Least grip over the tilt; None for the preload of the control alone.
        execution: Planned tilt, with the resulting scenario; None if it is not planned.
    """

    robot: RobotModel
    joint_path: JointPath
    grip: GripSchedule | None
    execution: Execution | None = None


def prepare(
    scenario: Scenario,
    control: Control,
    best_effort: bool = False,
    joint_path: JointPath | None = None,
    planning: Planning | None = None,
    robot: RobotModel | None = None,
    check: bool = True,
) -> Preparation:
    """Plan a run.

    Args:
        scenario: Scenario that the controller assumes.
        control: Settings of the controller.
        best_effort: Whether to go on although a certificate proves that no forces exist at a tilt.
        joint_path: Joint path of the scenario; planned here if left out.
        planning: How the tilt is planned; None for the scenario's own timing.
        robot: Model of the scenario's robots; built here if left out.
        check: Whether to look for tilts without forces; not done with `best_effort`.

    Raises:
        PathError: The arms cannot follow the path.
        PlanError: The planned tilt breaks a limit.
        UnholdableError: No forces hold the object somewhere on the path.
    """
    robot = robot or RobotModel(scenario)
    if planning is not None:
        planned = planned_tilt(scenario, planning, robot)
        return Preparation(robot, planned.joint_path, planned.grip, planned)
    joint_path = joint_path or plan_joints(scenario)
    if not control.feedforward:
        return Preparation(robot, joint_path, None)
    if check and not best_effort:
        _check(PathProblems(scenario, control, joint_path=joint_path, robot=robot))
    grip = plan_grip(scenario, control, joint_path, robot, best_effort)
    return Preparation(robot, joint_path, grip)


def _check(problems: PathProblems) -> None:
    synthesizer = Synthesizer()
    for tilt in problems.tilts(_CHECK_DEG).tolist():
        try:
            synthesizer.solve(problems.problem(tilt))
        except InfeasibleError:
            raise UnholdableError(explain(problems, tilt, synthesizer)) from None
        except (SolverError, UnboundedError):
            continue  # no proof of infeasibility: the controller handles it during the run
