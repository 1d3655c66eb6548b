"""The value of a placement as one cost; for an infeasible one it tells how much is missing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.model import (
    Names,
    ObjectMotion,
    RobotModel,
    compose,
    distance,
    is_solid,
    overlapping_links,
)
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.motion import JointGrid, PathError, plan_joints
from fulcrum.sim.placement.freedom import rounded, with_posture
from fulcrum.sim.planning import PathProblems
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis import InfeasibleError, Objective, SolverError, Synthesizer, UnboundedError
from fulcrum.synthesis.analysis import weight_range
from fulcrum.synthesis.arrays import Array


class Goal(StrEnum):
    """The goal of a search, over the whole path.

    HEAVIEST: the heaviest object that can be held is as heavy as possible. LARGEST_MARGIN: the
    largest share of its friction that a contact uses is as small as possible. LOWEST_TORQUE: the
    largest share of its torque limit that a joint uses is as small as possible.
    """

    HEAVIEST = "heaviest"
    LARGEST_MARGIN = "largest-margin"
    LOWEST_TORQUE = "lowest-torque"


@dataclass(frozen=True)
class Steps:
    """The step sizes with which a placement is evaluated.

    Attributes:
        grid: Steps of the joint path.
        solved: Pose error at which a step counts as solved [m and rad].
        tilt_deg: Step between the tilts at which forces are computed [deg].
        room: Fraction of each joint's range kept free at both ends [-].
    """

    grid: JointGrid
    solved: float
    tilt_deg: float
    room: float


# A cubic spline through the coarse steps is off by about 0.1 mm between them; the forces are
# computed at the steps themselves. The coarse grid has larger clearances, as it checks no places
# between its steps.
COARSE = Steps(
    JointGrid(15.0, 0.03, least=1, clearance_m=0.01), solved=1e-5, tilt_deg=15.0, room=0.02
)
FULL = Steps(JointGrid(), solved=1e-9, tilt_deg=5.0, room=0.0)

# Base costs of infeasible placements by defect, the worst first; its size adds at most 1.
_OVERLAPS, _OUT_OF_REACH, _STUCK, _CRAMPED, _WITHOUT_FORCES = 5.0, 4.0, 3.0, 2.0, 1.0
# Upper bound of the cost of feasible placements [-].
_FEASIBLE = 0.999
# Range assumed for joints without limits [rad].
_TURN = 2.0 * math.pi
# Clearance of the robots' fixed parts [m].
CLEARANCE = 0.005
# Number of tilts at which the object's distance to the fixed parts is checked.
_LOOKS = 7


@dataclass(frozen=True)
class Value:
    """The value of a placement.

    Attributes:
        cost: Cost that is minimised [-]; below 1 if forces exist all along the path.
        reason: Why the placement is infeasible; empty if it is feasible.
        heaviest: Weight of the heaviest object that can be held all along the path [N].
        friction: Largest share of its friction that a contact uses, as small as forces can make it
            [-]; infinite without forces.
        torque: Largest share of its torque limit that a joint uses, as small as forces can make it
            [-]; infinite without forces.
        clearance: Least distance of a joint to its limits [rad or m].
    """

    cost: float
    reason: str = ""
    heaviest: float = 0.0
    friction: float = math.inf
    torque: float = math.inf
    clearance: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether the arms can follow the path and forces exist all along it."""
        return not self.reason


def assess(
    scenario: Scenario,
    control: Control,
    goal: Goal,
    steps: Steps = FULL,
    tolerated: frozenset[Names] = frozenset(),
    whole: bool = True,
) -> Value:
    """Return the value of a placement.

    Args:
        scenario: Scene.
        control: Settings of the controller; friction factor and preload are used (see
            :func:`believed`).
        goal: Goal that gives the cost.
        steps: Step sizes of the evaluation.
        tolerated: Pairs of geoms that may touch at the start (see :func:`touching`).
        whole: Whether to compute all numbers, not only that of the goal.
    """
    depths = {pair: d for pair, d in _depths(scenario).items() if pair not in tolerated}
    if depths and max(depths.values()) > 0.0:
        worst = max(depths, key=lambda pair: depths[pair])
        cost = _OVERLAPS + depths[worst] / (1.0 + depths[worst])
        return Value(cost, f"{worst[0]} within {1e3 * CLEARANCE:g} mm of {worst[1]} at the start")
    try:
        joint_path = plan_joints(scenario, steps.solved, steps.grid)
    except PathError as error:
        if not error.share:
            return Value(_OUT_OF_REACH + error.error / (1.0 + error.error), str(error))
        return Value(_STUCK + 1.0 - error.share, str(error))
    robot = RobotModel(scenario)
    kept = steps.room * np.minimum(robot.q_max - robot.q_min, _TURN)
    tight = int((joint_path.clearance - kept).argmin())
    if joint_path.clearance[tight] < kept[tight]:
        cost = _CRAMPED + 1.0 - max(0.0, float(joint_path.clearance[tight] / kept[tight]))
        return Value(cost, f"{robot.joints[tight]} within {100 * steps.room:g} % of its limit")
    margins = believed(control, scenario)
    problems = PathProblems(scenario, margins, joint_path=joint_path)
    tilts = problems.tilts(steps.tilt_deg).tolist()
    synthesizer = Synthesizer()
    spans = [_span(problems, tilt, synthesizer) for tilt in tilts]
    weight, heaviest = problems.gravity(0.0).weight, min(high for _, high in spans)
    clearance = float(joint_path.clearance.min())
    lacks = [_lack(weight, *span) for span in spans]
    if any(lacks):
        at = int(np.argmax(lacks))
        low, high = spans[at]
        reason = f"at {tilts[at]:.0f} deg forces hold {low:.4g} to {high:.4g} N"
        if not high:
            reason = f"at {tilts[at]:.0f} deg no forces hold any weight"
        cost = _WITHOUT_FORCES + float(np.mean(lacks))
        return Value(cost, reason, heaviest, clearance=clearance)

    def largest(objective: Objective, asked: Goal) -> float:
        if not whole and goal is not asked:
            return math.inf
        return max(_best(problems, tilt, objective, synthesizer) for tilt in tilts)

    friction = largest(Objective.FRICTION_MARGIN, Goal.LARGEST_MARGIN) * margins.friction_factor
    torque = largest(Objective.MAX_TORQUE_UTILISATION, Goal.LOWEST_TORQUE)
    costs = {
        Goal.HEAVIEST: 1.0 / (1.0 + heaviest / weight),
        Goal.LARGEST_MARGIN: friction,
        Goal.LOWEST_TORQUE: torque,
    }
    return Value(min(costs[goal], _FEASIBLE), "", heaviest, friction, torque, clearance)


def over_tilt(
    scenario: Scenario, control: Control, step_deg: float
) -> tuple[Array, tuple[Array, Array, Array]]:
    """Return what limits a placement, by tilt.

    Args:
        scenario: Scene.
        control: Settings of the controller, as for :func:`assess`.
        step_deg: Largest step between tilts [deg].

    Returns:
        Tilts [deg], (k,), and by tilt the heaviest object [N], and the least shares of friction and
        of torque that are used [%], (k,) each; NaN without forces.

    Raises:
        PathError: The arms cannot follow the path.
    """
    margins = believed(control, scenario)
    problems, synthesizer = PathProblems(scenario, margins), Synthesizer()
    tilts = problems.tilts(step_deg)
    heaviest = [_span(problems, tilt, synthesizer)[1] for tilt in tilts.tolist()]
    used = [
        [_best(problems, tilt, objective, synthesizer) for tilt in tilts.tolist()]
        for objective in (Objective.FRICTION_MARGIN, Objective.MAX_TORQUE_UTILISATION)
    ]
    friction, torque = (np.where(np.isfinite(u), 100.0 * np.array(u), np.nan) for u in used)
    return tilts, (np.array(heaviest), margins.friction_factor * friction, torque)


def believed(control: Control, scenario: Scenario) -> Control:
    """Return the control with fixed margins only; a robust one is replaced by its preload."""
    robustness = control.robustness
    if robustness is None:
        return control
    # Only if every hand may press harder than that (see fulcrum.sim.planning.robust_grip).
    able = all(hand.f_n_max > robustness.preload for hand in scenario.hands)
    preload = max(control.preload, robustness.preload) if able else control.preload
    return replace(control, preload=preload, robustness=None)


def settled(scenario: Scenario) -> Scenario:
    """Return the scenario with a start posture in which its hands are at their contacts.

    Raises:
        PathError: The arms cannot follow the path.
    """
    robot = RobotModel(scenario)
    angles = [rounded(angle) for angle in plan_joints(scenario).holding(0.0).tolist()]
    within = np.clip(angles, robot.q_min, robot.q_max).tolist()
    return with_posture(scenario, dict(zip(robot.joints, within, strict=True)))


def touching(scenario: Scenario) -> frozenset[Names]:
    """Return the pairs that touch in the given scenario, and therefore may: see :func:`assess`."""
    return frozenset(pair for pair, depth in _depths(scenario).items() if depth > 0.0)


def _depths(scenario: Scenario) -> dict[Names, float]:
    """Return the depths by which parts of the robots violate their clearances [m], by pair.

    These are fixed parts too near to the object or environment anywhere on the path, and links that
    overlap in the start posture, which inverse kinematics does not check.
    """
    model = compose(scenario, ObjectMotion.POSED).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = [scenario.posture[model.joint(j).name] for j in range(model.njnt)]
    around = (*scenario.object.geoms, *scenario.environment)
    solid = [model.geom(g.name).id for g in around if g.solid]
    names = [g.name for g in around]
    fixed = [
        g
        for g in range(model.ngeom)
        if model.body_weldid[model.geom_bodyid[g]] == 0
        and model.geom(g).name not in names
        and is_solid(model.geom(g))
    ]
    path, thing = object_path(scenario.path), model.body(scenario.object.name).mocapid[0]
    depths: dict[Names, float] = {}
    for tilt in np.linspace(0.0, path.end, _LOOKS):
        R_WO, data.mocap_pos[thing] = path.pose(float(tilt))
        data.mocap_quat[thing] = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
        mujoco.mj_kinematics(model, data)
        for g in fixed:
            for other in solid:
                pair = model.geom(g).name, model.geom(other).name
                depth = CLEARANCE - distance(model, data, g, other)
                depths[pair] = max(depths.get(pair, 0.0), depth)
    links = overlapping_links(scenario, model, data)
    return depths | {pair: max(depth, 0.0) + CLEARANCE for pair, depth in links.items()}


def _span(problems: PathProblems, tilt: float, synthesizer: Synthesizer) -> tuple[float, float]:
    """Return the weights of the lightest and heaviest object that can be held at a tilt [N]."""
    try:
        return weight_range(problems.problem(tilt), problems.gravity(tilt), synthesizer)
    except (InfeasibleError, SolverError):
        return 0.0, 0.0


def _lack(weight: float, low: float, high: float) -> float:
    """Return the distance of a weight from a range [-]: 0 within it, 1 if the range is empty."""
    return max(0.0, 1.0 - high / weight, 1.0 - weight / low if low else 0.0)


def _best(
    problems: PathProblems, tilt: float, objective: Objective, synthesizer: Synthesizer
) -> float:
    try:
        problem = replace(problems.problem(tilt), objective=objective)
        return synthesizer.solve(problem).value
    except (InfeasibleError, SolverError, UnboundedError):
        return math.inf
