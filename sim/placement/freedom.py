"""The freedom of a placement: its variables between 0 and 1, and the scenario that they give."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import Pose, triple, wxyz
from fulcrum.sim.model import compose, contact_axes
from fulcrum.sim.placement.faces import Range, faces_of, moved, shape_of
from fulcrum.sim.placement.mirror import chains, find_mirror
from fulcrum.sim.scenario import Hand, Robot, Scenario
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array

_FIXED: Range = (0.0, 0.0)
_RANGES = ("x", "y", "height", "yaw_deg", "turn_deg", "posture_deg")
# Share of a joint's range that start angles keep free at both ends [-].
_RANGE_LEFT = 0.05
# Digits of metres and degrees; rounded before the test, so that the written values were tested.
_DIGITS_M, _DIGITS_DEG = 4, 2


@dataclass(frozen=True)
class Freedom:
    """The ranges in which a placement may differ from the present one; from 0 to 0 nothing moves.

    A scene with two hands that mirror each other stays symmetric: the robots then move only within
    the mirror plane, and do not turn in yaw.

    Attributes:
        x, y: Displacement of the robots' bases, all together, along the world's axes [m].
        height: Change of the bases' height [m].
        yaw_deg: Rotation of the bases about the vertical through the path's point [deg].
        faces: Faces of the object that hands may touch besides their present one, by hand; hands
            left out do not move. None: all hands may move, each on its present face.
        border: Distance that contacts keep from the ends of their faces [m].
        turn_deg: Rotation of the hands about their contact normals [deg].
        posture_deg: Change of the start angles of revolute joints, at which inverse kinematics
            starts [deg].
    """

    x: Range = (-0.4, 0.4)
    y: Range = (-0.4, 0.4)
    height: Range = _FIXED
    yaw_deg: Range = (-60.0, 60.0)
    faces: dict[str, tuple[str, ...]] | None = None
    border: float = 0.02
    turn_deg: Range = (-90.0, 90.0)
    posture_deg: Range = (-60.0, 60.0)

    def __post_init__(self) -> None:
        for name in _RANGES:
            low, high = getattr(self, name)
            if not (math.isfinite(low) and math.isfinite(high) and low <= 0.0 <= high):
                valid = "a finite range that contains 0"
                raise InvalidInputError(f"freedom.{name}", (low, high), valid)
        if not (math.isfinite(self.border) and self.border >= 0.0):
            raise InvalidInputError("freedom.border", self.border, "a finite distance >= 0 m")


@dataclass(frozen=True)
class _Variable:
    """One variable of the search: its name, its range, and its value in the given scenario."""

    name: str
    low: float
    high: float
    now: float = 0.0


class Moves:
    """The variables of a scenario with a freedom.

    Attributes:
        names: Names of the variables, (d,).
        start: Values of the given scenario in [0, 1], (d,).
        mirror: Mirror symmetry that is kept; None if there is none.
    """

    def __init__(self, scenario: Scenario, freedom: Freedom) -> None:
        """Find the variables.

        Args:
            scenario: Scenario with the present placement.
            freedom: Ranges in which it may move.

        Raises:
            InvalidInputError: Nothing may move, a named hand does not exist, or a contact that may
                move is not on a face.
        """
        self._scenario = scenario
        self.mirror = find_mirror(scenario)
        names = [hand.name for hand in scenario.hands]
        allowed = dict.fromkeys(names, ()) if freedom.faces is None else freedom.faces
        for name in allowed:
            if name not in names:
                raise InvalidInputError("freedom.faces", name, f"one of {', '.join(names)}")
        followers = () if self.mirror is None else (self.mirror.hands[1].name,)
        self._leaders = [hand for hand in scenario.hands if hand.name not in followers]
        self._faces = {
            hand.name: faces_of(scenario, hand, allowed[hand.name], freedom.border)
            for hand in self._leaders
            if hand.name in allowed
        }
        variables = self._of_bases(freedom)
        for hand in self._leaders:
            variables += self._of_hand(hand, freedom)
        self._joints = _joint_ranges(scenario, freedom.posture_deg)
        if self.mirror is not None:
            for image, _ in self.mirror.joints.values():
                self._joints.pop(image, None)
        now = scenario.posture
        variables += [
            _Variable(f"posture {joint}", *ends, math.degrees(now[joint]))
            for joint, ends in self._joints.items()
        ]
        variables = [v for v in variables if v.high > v.low]
        if not variables:
            valid = "one with something that may move"
            raise InvalidInputError("freedom", "one in which all stays", valid)
        self.names = tuple(v.name for v in variables)
        self._low = np.array([v.low for v in variables])
        self._high = np.array([v.high for v in variables])
        self.start = (np.array([v.now for v in variables]) - self._low) / (self._high - self._low)

    def scenario(self, x: Array) -> Scenario:
        """Return the scenario at x in [0, 1], (d,)."""
        values = self._low + np.clip(x, 0.0, 1.0) * (self._high - self._low)
        named = dict(zip(self.names, values.tolist(), strict=True))
        hands = {hand.name: hand for hand in self._scenario.hands}
        for hand in self._leaders:
            hands[hand.name] = self._held(hand, named)
        posture = {
            joint: rounded(math.radians(named[f"posture {joint}"]))
            for joint in self._joints
            if f"posture {joint}" in named
        }
        if self.mirror is not None:
            first, second = self.mirror.hands
            hands[second.name] = self._image(second, hands[first.name])
            for joint, (image, sign) in self.mirror.joints.items():
                posture[image] = sign * posture.get(joint, self._scenario.posture[joint])
        robots = tuple(_based(robot, self._scenario, named) for robot in self._scenario.robots)
        placed = replace(self._scenario, robots=robots, hands=tuple(hands.values()))
        return with_posture(placed, posture)

    def _of_bases(self, freedom: Freedom) -> list[_Variable]:
        variables = [
            _Variable("base x", *freedom.x),
            _Variable("base y", *freedom.y),
            _Variable("base yaw", *freedom.yaw_deg),
            _Variable("base height", *freedom.height),
        ]
        if self.mirror is None:
            return variables
        across = "base x" if self.mirror.normal_W[0] else "base y"
        return [v for v in variables if v.name not in (across, "base yaw")]

    def _of_hand(self, hand: Hand, freedom: Freedom) -> list[_Variable]:
        variables = [_Variable(f"{hand.name} turn", *freedom.turn_deg)]
        faces = self._faces.get(hand.name)
        if faces is None:
            return variables
        places = [
            (f"{hand.name} {axis}", share) for axis, share in zip("uv", faces.shares, strict=True)
        ]
        variables += [_Variable(name, 0.0, 1.0, share) for name, share in places]
        if len(faces.names) > 1:
            variables.append(_Variable(f"{hand.name} face", 0.0, 1.0))
        return variables

    def _held(self, hand: Hand, values: dict[str, float]) -> Hand:
        """Return a hand on one of its faces, rotated about its contact normal."""
        name, faces = hand.name, self._faces.get(hand.name)
        if faces is not None:
            face = values.get(f"{name} face", 0.0)
            hand = faces.held(face, values[f"{name} u"], values[f"{name} v"])
        degrees = round(values.get(f"{name} turn", 0.0), _DIGITS_DEG)
        if not degrees:
            return hand
        angle = math.radians(degrees)
        axes = contact_axes(hand.normal_O, hand.tangent_O)
        return replace(hand, tangent_O=triple(axes @ [math.cos(angle), math.sin(angle), 0.0]))

    def _image(self, second: Hand, first: Hand) -> Hand:
        """Return the second hand as the image of the first, with the sign of its own tangent."""
        assert self.mirror is not None
        mirrored = self.mirror.direction
        own = self.mirror.hands[0]
        # The image's tangent may have either sign: use that of the given second hand.
        sign = math.copysign(1.0, np.dot(mirrored(own.tangent_O), second.tangent_O))
        tangent = triple(sign * np.array(mirrored(first.tangent_O)))
        if first.p_OC_O == own.p_OC_O:
            return replace(second, tangent_O=tangent)
        point, normal = self.mirror.point(first.p_OC_O), mirrored(first.normal_O)
        held = moved(second, point, normal, shape_of(self._scenario))
        return replace(held, tangent_O=tangent)


def rounded(angle: float) -> float:
    """Return an angle [rad], rounded to few digits in degrees."""
    return math.radians(round(math.degrees(angle), _DIGITS_DEG))


def with_posture(scenario: Scenario, posture: dict[str, float]) -> Scenario:
    """Return the scenario with new start positions [rad or m] of joints, by their scene names."""
    robots = []
    for robot in scenario.robots:
        own = {joint: posture.get(robot.prefix + joint, q) for joint, q in robot.posture.items()}
        robots.append(replace(robot, posture=own))
    return replace(scenario, robots=tuple(robots))


def _joint_ranges(scenario: Scenario, around_deg: Range) -> dict[str, Range]:
    """Return the allowed ranges of start angles [deg], by joint that carries a hand."""
    scene = compose(scenario).compile()
    ranges = {}
    for name in dict.fromkeys(j for chain in chains(scene, scenario).values() for j in chain):
        joint = scene.joint(name)
        if joint.type[0] != mujoco.mjtJoint.mjJNT_HINGE or name in scenario.still:
            continue
        low, high = np.degrees(joint.range).tolist() if joint.limited[0] else (-180.0, 180.0)
        angle, room = math.degrees(scenario.posture[name]), _RANGE_LEFT * (high - low)
        ends = max(low + room, angle + around_deg[0]), min(high - room, angle + around_deg[1])
        ranges[name] = (min(ends[0], angle), max(ends[1], angle))
    return ranges


def _based(robot: Robot, scenario: Scenario, values: dict[str, float]) -> Robot:
    """Return a robot with its base moved."""
    moves = [round(values.get(f"base {axis}", 0.0), _DIGITS_M) for axis in ("x", "y", "height")]
    degrees = round(values.get("base yaw", 0.0), _DIGITS_DEG)
    base, point = robot.base, np.asarray(scenario.path.point_W, float)
    if not degrees:
        position = triple(np.array(base.position, float) + moves)
        return replace(robot, base=Pose(position, base.quaternion))
    turn = Rotation.from_rotvec([0.0, 0.0, math.radians(degrees)])
    position = triple(point + turn.apply(np.asarray(base.position) - point) + moves)
    return replace(robot, base=Pose(position, wxyz(turn * base.rotation)))
