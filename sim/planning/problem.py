"""The path problem of a scenario's tilt: contacts, inertia of object and robots, all limits."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import Object
from fulcrum.sim.model import ObjectPath, RobotModel, Statics, gravity, inertial_wrenches
from fulcrum.sim.model.contacts import contacts
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.motion import JointPath, plan_joints
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis import InvalidInputError, Problem
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.checks import not_negative, positive
from fulcrum.synthesis.path import Accelerations, InertialTorques, Load, PathProblem, Rates
from fulcrum.synthesis.robust import UncertaintySet

# Degree of the spline through the joint angles, and their pose error [m and rad]. A cubic spline
# and a tenth of the accuracy would suffice for the angles, but not for their second derivative.
_DEGREE, _SOLVED = 7, 1e-10

CERTAIN = UncertaintySet()


@dataclass(frozen=True)
class Margins:
    """Margins of a plan to its limits.

    Attributes:
        friction_factor: Share of the friction that may be used [-].
        limits: Share of the robot's torque and speed limits that may be used [-].
        grip_min, grip_max: Bounds of the hands' normal forces [N], besides those of the contacts.
        tip_speed: Largest speed of the hands' contacts [m/s].
        tip_acceleration: Largest acceleration of the hands' contacts [m/s^2]; smaller values set
            the object down more softly.
    """

    friction_factor: float = 0.8
    limits: float = 0.9
    grip_min: float = 5.0
    grip_max: float = 60.0
    tip_speed: float = math.inf
    tip_acceleration: float = math.inf

    def __post_init__(self) -> None:
        for name in ("friction_factor", "limits"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InvalidInputError(f"margins.{name}", getattr(self, name), "in (0, 1]")
        not_negative("margins.grip_min", self.grip_min)
        positive("margins.grip_max", self.grip_max)
        if self.grip_max < self.grip_min:
            valid = f"at least grip_min = {self.grip_min:g} N"
            raise InvalidInputError("margins.grip_max", self.grip_max, valid)
        for name in ("tip_speed", "tip_acceleration"):
            if not getattr(self, name) > 0.0:
                raise InvalidInputError(f"margins.{name}", getattr(self, name), "a number > 0")


def own_margins(control: Control) -> Margins:
    """Return margins with the friction factor and preload of a control."""
    return Margins(friction_factor=control.friction_factor, grip_min=control.preload)


def path_problem(
    scenario: Scenario,
    margins: Margins,
    points: int,
    uncertainty: UncertaintySet = CERTAIN,
    robot: RobotModel | None = None,
) -> tuple[PathProblem, BSpline, tuple[str, ...]]:
    """Return the path problem of a tilt, the joint angles over its share, and the joints' names.

    Args:
        scenario: The scene, whose path the arms follow.
        margins: Margins to all limits.
        points: Number of grid points.
        uncertainty: Deviations of the world from the scenario with its true friction. One timing
            and one grip serve the whole set, and the scenario itself with the margins' friction
            factor, which is the first load.
        robot: Model of the scenario's robots; built if left out.

    Raises:
        PathError: The arms cannot follow the path.
    """
    robot, path = robot or RobotModel(scenario), object_path(scenario.path)
    gripped = _gripped(scenario, margins.grip_max)
    control = Control(friction_factor=margins.friction_factor, preload=margins.grip_min)
    believed = Statics(gripped, control)
    true = contacts(gripped, replace(control, friction_factor=1.0))
    corners = [] if uncertainty == CERTAIN else _corners(scenario.object, uncertainty)
    placed: tuple[Problem, ...] = ()
    curve = tilting_curve(plan_joints(scenario, _SOLVED))
    s = np.linspace(0.0, 1.0, points)
    q, slope, curvature = curve(s), curve(s, 1), curve(s, 2)
    problems: list[list[Problem]] = []
    torques = np.empty((2, *q.shape))
    for k in range(points):
        state = robot.at(q[k])
        torques[:, k] = state.inertial_torques(slope[k], curvature[k])
        R_WO, p_WO = path.pose(path.end * s[k])
        quaternion = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
        at_rest = believed.problem(state, p_WO, quaternion, path.end * s[k])
        problems.append([_within(at_rest, margins.limits)])
        if corners:
            placed = uncertainty.placed(replace(problems[k][0], contacts=true))
            weights = [gravity(corner, R_WO).wrench_O for corner in corners]
            problems[k] += [replace(p, w_ext_O=w) for w in weights for p in placed]
    rates, accelerations = _tips(scenario, margins, path, s)
    inertia = [_inertia(scenario, thing, path, s) for thing in (scenario.object, *corners)]
    inertia[1:] = [each for each in inertia[1:] for _ in placed]
    problem = PathProblem(
        s=s,
        loads=tuple(
            Load(along_path, w_a_O, w_b_O)
            for along_path, (w_a_O, w_b_O) in zip(zip(*problems, strict=True), inertia, strict=True)
        ),
        inertial_torques=InertialTorques(torques[0], torques[1], slope * robot.damping),
        rates=Rates(
            (*robot.joints, *rates.names),
            np.hstack([slope, rates.slopes]),
            np.concatenate([margins.limits * robot.qd_max, rates.limits]),
        ),
        accelerations=accelerations,
    )
    return problem, curve, robot.joints


def _corners(thing: Object, uncertainty: UncertaintySet) -> list[Object]:
    """Return the object with every combination of extreme mass and centre of mass."""
    shares = {1.0 - uncertainty.mass, 1.0 + uncertainty.mass}
    places = [
        {place - offset, place + offset}
        for place, offset in zip(thing.center_of_mass, uncertainty.center, strict=True)
    ]
    return [
        replace(thing.weighing(share), center_of_mass=(x, y, z))
        for share, x, y, z in itertools.product(sorted(shares), *map(sorted, places))
    ]


def _inertia(scenario: Scenario, thing: Object, path: ObjectPath, s: Array) -> tuple[Array, Array]:
    """Return the inertial wrenches of an object per acceleration and squared rate of s, (K, 6)."""
    world = replace(scenario, object=thing)
    wrenches = np.array([inertial_wrenches(world, path, path.end * x) for x in s])
    return path.end * wrenches[:, 0], path.end**2 * wrenches[:, 1]


def _gripped(scenario: Scenario, grip_max: float) -> Scenario:
    """Return the scenario with the hands' normal forces bounded by `grip_max` [N]."""
    hands = (replace(hand, f_n_max=min(hand.f_n_max, grip_max)) for hand in scenario.hands)
    return replace(scenario, hands=tuple(hands))


def tilting_curve(path: JointPath) -> BSpline:
    """Return the joint angles over the share of the tilt, through all phases that tilt the object.

    Raises:
        InvalidInputError: No phase tilts it, or one tilts it back.
    """
    shares: list[Array] = []
    angles: list[Array] = []
    for index, phase in enumerate(path.schedule.phases):
        before = path.schedule.before(index).tilt
        if phase.tilt < before:
            raise InvalidInputError(f"phase {phase.name}.tilt", phase.tilt, f"at least {before:g}")
        if phase.tilt > before:
            skip = 1 if shares else 0
            shares.append((before + (phase.tilt - before) * path.progress[index])[skip:])
            angles.append(path.q[index][skip:])
    if not shares:
        raise InvalidInputError("phases", "none that tilts", "a phase that tilts the object")
    return make_interp_spline(np.concatenate(shares), np.concatenate(angles), k=_DEGREE)


def _within(problem: Problem, share: float) -> Problem:
    """Return the problem with the torque limits multiplied by `share`."""
    joints = problem.joints
    assert joints is not None
    limited = replace(joints, tau_min=share * joints.tau_min, tau_max=share * joints.tau_max)
    return replace(problem, joints=limited)


def _tips(
    scenario: Scenario, margins: Margins, path: ObjectPath, s: Array
) -> tuple[Rates, Accelerations]:
    """Return limits on speeds and accelerations of the hands' contacts on the object."""
    places = [np.asarray(hand.p_OC_O) for hand in scenario.hands]
    derivatives = np.array([[path.derivatives(path.end * x, p) for p in places] for x in s])
    slopes, curvatures = path.end * derivatives[:, :, 0], path.end**2 * derivatives[:, :, 1]
    names = tuple(hand.name for hand in scenario.hands)
    speeds = np.full(len(names), margins.tip_speed)
    rates = Rates(names, np.linalg.norm(slopes, axis=2), speeds)
    limits = np.full(len(names), margins.tip_acceleration)
    return rates, Accelerations(names, slopes, curvatures, limits)
