"""What is planned before anything moves, and refused if it cannot be done."""

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

# Steps at which the path is checked for forces [deg].
_CHECK_DEG = 5.0


class UnholdableError(FulcrumError):
    """Somewhere on the path no forces hold the object within all limits; nothing has moved."""

    def __init__(self, explanation: Explanation) -> None:
        self.explanation = explanation
        super().__init__(
            f"{explanation.scenario} cannot be held at {explanation.tilt_deg:g} deg: "
            f"{explanation.conflict.sentence if explanation.conflict else ''}."
        )


@dataclass(frozen=True, eq=False)
class Preparation:
    """What depends on belief and controller alone, so that runs can share it.

    Attributes:
        robot: The controller's model of the robots.
        joint_path: How the arms follow the object's path.
        grip: The least grip over the tilt; None for the control's preload alone.
        execution: The planned tilt, with the scenario that it makes; None if it is not planned.
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
    """Plans a run.

    Args:
        scenario: What the controller believes.
        control: The controller.
        best_effort: Whether to go on where a certificate proves that no forces exist at one of the
            path's tilts.
        joint_path: The scenario's, where it is planned already.
        planning: How the tilt is planned; None for the scenario's own timing.
        robot: The scenario's, where it is built already.
        check: Whether to look for tilts without forces, where there is no best effort.

    Raises:
        PathError: The arms cannot follow the path.
        PlanError: The planned tilt breaks a limit.
        UnholdableError: Somewhere on it no forces hold the object.
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
            continue  # no proof: the controller copes with those as they come
