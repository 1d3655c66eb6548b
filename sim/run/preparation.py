"""What is planned before anything moves, and refused if it cannot be done."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.sim.analysis.explain import explain
from fulcrum.sim.analysis.explanation import Explanation
from fulcrum.sim.model.grip import GripSchedule
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.joint_path import JointPath
from fulcrum.sim.planning.execution import Execution, Planning, planned_tilt
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.planning.robust_grip import plan_grip
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.scenario import Scenario
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
        joint_path: How the arms follow the object's path.
        grip: The least grip over the tilt; None for the control's preload alone.
        execution: The planned tilt, with the scenario that it makes; None if it is not planned.
    """

    joint_path: JointPath
    grip: GripSchedule | None
    execution: Execution | None = None

    @staticmethod
    def of(execution: Execution) -> Preparation:
        """That of a planned tilt."""
        return Preparation(execution.joint_path, execution.grip, execution)


def prepare(
    scenario: Scenario,
    control: Control,
    check: bool = True,
    joint_path: JointPath | None = None,
    planning: Planning | None = None,
) -> Preparation:
    """Plans a run.

    Args:
        scenario: What the controller believes.
        control: The controller.
        check: Whether to refuse what a certificate proves infeasible at one of the path's tilts.
        joint_path: The scenario's, where it is planned already.
        planning: How the tilt is planned; None for the scenario's own timing.

    Raises:
        PathError: The arms cannot follow the path.
        PlanError: The planned tilt breaks a limit.
        UnholdableError: Somewhere on it no forces hold the object.
    """
    if planning is not None:
        return Preparation.of(planned_tilt(scenario, planning))
    joint_path = joint_path or plan_joints(scenario)
    if not control.feedforward:
        return Preparation(joint_path, None)
    if check:
        _check(PathProblems(scenario, control, joint_path=joint_path))
    return Preparation(joint_path, plan_grip(scenario, control, joint_path))


def _check(problems: PathProblems) -> None:
    synthesizer = Synthesizer()
    for tilt in problems.tilts(_CHECK_DEG).tolist():
        try:
            synthesizer.solve(problems.problem(tilt))
        except InfeasibleError:
            raise UnholdableError(explain(problems, tilt, synthesizer)) from None
        except (SolverError, UnboundedError):
            continue  # no proof: the controller copes with those as they come
