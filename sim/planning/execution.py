"""Runs with a planned tilt: the plan's timing, grip and tolerances in the manoeuvre."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.sim.model import GripSchedule, RobotModel
from fulcrum.sim.motion import JointPath, Schedule, plan_joints
from fulcrum.sim.planning.plan import Plan
from fulcrum.sim.planning.problem import CERTAIN, Margins, own_margins
from fulcrum.sim.planning.robust_plan import robust_plan
from fulcrum.sim.scenario import Phase, Scenario, Timing, controllers, stretched, tilting
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.checks import positive
from fulcrum.synthesis.path import PathObjective

# Duration at which no arm reaches its speed limits, so that the joint path is purely geometric.
_SLOW_S = 10.0


@dataclass(frozen=True)
class Planning:
    """Options for planning the tilt of a run, with the margins of the scenario's control.

    Attributes:
        stretch: Factor on the planned duration [-].
        points: Number of grid points of the plan.
        objective: Objective of the plan.
        duration: Longest duration of the plan before it is stretched [s].
        robust: Whether the plan also holds for the uncertainty set of controller ``robust``, or for
            the largest share of it that one grip can serve.
    """

    stretch: float = 1.0
    points: int = 100
    objective: PathObjective = PathObjective.LEAST_TIME
    duration: float = math.inf
    robust: bool = False

    def __post_init__(self) -> None:
        positive("stretch", self.stretch)
        if not self.duration > 0.0:
            raise InvalidInputError("duration", self.duration, "a time > 0 s")

    @property
    def options(self) -> str:
        """Options of the command line for this planning."""
        words = [f"--plan {self.objective} --stretch {self.stretch!r}"]
        words += [f"--duration {self.duration!r}"] if math.isfinite(self.duration) else []
        words += ["--robust"] if self.robust else []
        return " ".join(words)


@dataclass(frozen=True, eq=False)
class Execution:
    """A scenario with a planned tilt.

    Attributes:
        scenario: Scenario with the plan's timing, and tolerances for fast tilts.
        planning: Options of the planning.
        plan: The plan.
        joint_path: Joint angles along the manoeuvre.
        grip: Normal forces of the plan, as least normal forces of the hands.
    """

    scenario: Scenario
    planning: Planning
    plan: Plan
    joint_path: JointPath
    grip: GripSchedule


def planned_tilt(
    scenario: Scenario, planning: Planning, robot: RobotModel | None = None
) -> Execution:
    """Plan the tilt of a scenario, and return the scenario with the plan in its manoeuvre.

    Raises:
        InvalidInputError: No single phase does the whole tilt.
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits.
    """
    # The plan must not depend on the scenario's timing, which may be a planned one.
    slow = replace(scenario, phases=stretched(scenario.phases, _SLOW_S))
    planned = made_plan(slow, own_margins(scenario.control), planning, robot)
    found = planned.solution
    squared = np.maximum(found.b, 0.0)
    timing = Timing(tuple(found.problem.s.tolist()), tuple(squared.tolist()))
    limits = scenario.tolerances
    fast = replace(
        scenario,
        phases=timed(scenario.phases, timing),
        tolerances=replace(
            limits,
            final_deg=0.5,
            error_deg=1.0,
            slip_mm=1.0,
            spin_deg=0.2,  # numerical: at most 0.13, and a quarter of that at half the step
            utilisation=1.01,  # slip is judged instead; values above 1 are rounding
            force_error=0.1,  # 5 % without deviations, since forces jump with the acceleration
            support_force_error=0.1,
            saturated_s=0.02,
        ),
    )
    joint_path = replace(plan_joints(slow), schedule=Schedule(fast))
    return Execution(fast, planning, planned, joint_path, _grip(planned))


def made_plan(
    scenario: Scenario, margins: Margins, planning: Planning, robot: RobotModel | None = None
) -> Plan:
    """Return the plan of a scenario's tilt for given options.

    Raises:
        PathError: The arms cannot follow the path.
        PlanError: No timing keeps all limits.
    """
    robustness = controllers(scenario.control)["robust"].robustness
    assert robustness is not None
    return robust_plan(
        scenario,
        margins,
        robustness.uncertainty if planning.robust else CERTAIN,
        planning.objective,
        planning.duration,
        planning.points,
        planning.stretch,
        robot,
    )


def timed(phases: tuple[Phase, ...], timing: Timing) -> tuple[Phase, ...]:
    """Return the phases, with a timing for the one that tilts.

    Raises:
        InvalidInputError: No single phase does the whole tilt.
    """
    index = _whole_tilt(phases)
    phase = replace(phases[index], duration_s=timing.duration, timing=timing)
    return (*phases[:index], phase, *phases[index + 1 :])


def _whole_tilt(phases: tuple[Phase, ...]) -> int:
    turns = tilting(phases)
    if len(turns) != 1 or phases[turns[0]].tilt != 1.0:
        given = [phases[i].name for i in turns]
        raise InvalidInputError("phases that tilt", given, "one, which does the whole tilt")
    return turns[0]


def _grip(planned: Plan) -> GripSchedule:
    """Return the larger normal forces of the two adjacent intervals at each grid point."""
    found, hands = planned.solution, len(planned.scenario.hands)
    f_n = found.w_OC_C[0][:, :hands, N]
    first, last = f_n[:1], f_n[-1:]
    between = np.maximum(f_n[1:-1:2], f_n[2:-1:2])
    grid = np.concatenate([first, between, last])
    return GripSchedule(planned.tilt, grid, np.full(len(grid), planned.share))
