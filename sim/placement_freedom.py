"""What may move in a placement, as a vector of numbers between 0 and 1, and what it makes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

from sim.contacts import contact_axes
from sim.path import rotation
from sim.placement_face import Face, face_of
from sim.placement_mirror import Mirror, chains, find_mirror
from sim.scenario import Hand, Pose, Scenario, Vector
from sim.scene import compose
from synthesis import InvalidInputError
from synthesis.contact import Array

Range = tuple[float, float]

_FIXED = (0.0, 0.0)
# Start angles keep this share of their joint's range clear of its ends [-].
_RANGE_LEFT = 0.05


@dataclass(frozen=True)
class Freedom:
    """How far from where it is everything may move; a range from 0 to 0 leaves it there.

    A scene with two hands that mirror each other stays its own mirror image: the robot then moves
    in the mirror plane alone, and neither sideways nor in yaw.

    Attributes:
        x, y: Of the robot's base along the world's axes [m].
        height: Of the base [m].
        yaw_deg: Of the base about the vertical through the path's point [deg].
        faces: Names of the hands whose contacts may move all over the face they are on; None for
            all hands.
        border: Distance that contacts keep from the ends of their face [m].
        turn_deg: Of the hands about their contact normals [deg].
        posture: Of the start angles of revolute joints, from which inverse kinematics seeks [rad].
    """

    x: Range = (-0.3, 0.3)
    y: Range = (-0.3, 0.3)
    height: Range = _FIXED
    yaw_deg: Range = (-60.0, 60.0)
    faces: tuple[str, ...] | None = None
    border: float = 0.02
    turn_deg: Range = (-90.0, 90.0)
    posture: Range = (-1.0, 1.0)

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name in ("faces", "border"):
                continue
            low, high = getattr(self, field.name)
            if not (math.isfinite(low) and math.isfinite(high) and low <= 0.0 <= high):
                valid = "a finite range that contains 0"
                raise InvalidInputError(f"freedom.{field.name}", (low, high), valid)
        if not (math.isfinite(self.border) and self.border >= 0.0):
            raise InvalidInputError("freedom.border", self.border, "a finite distance >= 0 m")


@dataclass(frozen=True)
class _Variable:
    """One number that is sought: its name, range, and value as the scenario stands."""

    name: str
    low: float
    high: float
    now: float = 0.0


class Moves:
    """The variables of a scenario with a freedom.

    Attributes:
        names: Of the variables, (d,).
        start: Where the scenario stands, each in [0, 1], (d,).
        mirror: The mirror plane that is kept; None if there is none.
    """

    def __init__(self, scenario: Scenario, freedom: Freedom) -> None:
        """Finds the variables.

        Raises:
            InvalidInputError: Nothing may move, a hand named is not there, or a contact that may
                move is on no face, or off it.
        """
        self._scenario = scenario
        self.mirror = find_mirror(scenario)
        self._joints = _joint_ranges(scenario, freedom.posture)
        self._variables = self._base(freedom)
        names = [hand.name for hand in scenario.hands]
        for name in freedom.faces or ():
            if name not in names:
                raise InvalidInputError("freedom.faces", name, f"of {', '.join(names)}")
        self._moving = names if freedom.faces is None else list(freedom.faces)
        self._faces: dict[str, Face] = {}
        followers = () if self.mirror is None else (self.mirror.hands[1].name,)
        self._leaders = [hand for hand in scenario.hands if hand.name not in followers]
        for hand in self._leaders:
            self._variables += self._of_hand(hand, freedom)
        self._variables += self._of_posture()
        self._variables = [v for v in self._variables if v.high > v.low]
        if not self._variables:
            raise InvalidInputError("freedom", freedom, "a freedom with something that may move")
        self.names = tuple(v.name for v in self._variables)
        self._low = np.array([v.low for v in self._variables])
        self._high = np.array([v.high for v in self._variables])
        now = np.array([v.now for v in self._variables])
        self.start = (now - self._low) / (self._high - self._low)

    def values(self, x: Array) -> dict[str, float]:
        """Values of the variables [m, deg or rad] by name, at x in [0, 1], (d,)."""
        values = self._low + np.clip(x, 0.0, 1.0) * (self._high - self._low)
        return dict(zip(self.names, values.tolist(), strict=True))

    def scenario(self, x: Array) -> Scenario:
        """The scenario at x in [0, 1], (d,)."""
        values = self.values(x)
        moved = _moved(self._scenario, values)
        hands = {hand.name: hand for hand in moved.hands}
        posture = dict(moved.robot.posture)
        for hand in self._leaders:
            hands[hand.name] = self._held(hand, values)
        for joint in self._joints:
            posture[joint] = values.get(f"posture {joint}", posture[joint])
        if self.mirror is not None:
            first, second = self.mirror.hands
            hands[second.name] = self._image(second, hands[first.name], values)
            for joint, (image, sign) in self.mirror.joints.items():
                posture[image] = sign * posture[joint]
        robot = replace(moved.robot, posture=posture)
        return replace(moved, robot=robot, hands=tuple(hands.values()))

    def _base(self, freedom: Freedom) -> list[_Variable]:
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
        variables = []
        if hand.name in self._moving:
            face = face_of(self._scenario, hand, freedom.border)
            self._faces[hand.name] = face
            now = face.coordinates(hand.p_OC_O)
            variables += [
                _Variable(f"{hand.name} {axis}", *ends, at)
                for axis, ends, at in zip("uv", face.ranges, now, strict=True)
            ]
        return [*variables, _Variable(f"{hand.name} turn", *freedom.turn_deg)]

    def _of_posture(self) -> list[_Variable]:
        images = set()
        if self.mirror is not None:
            images = {image for image, _ in self.mirror.joints.values()}
        return [
            _Variable(f"posture {joint}", *ends, self._scenario.robot.posture[joint])
            for joint, ends in self._joints.items()
            if joint not in images
        ]

    def _held(self, hand: Hand, values: dict[str, float]) -> Hand:
        """A hand on its own face, turned about its normal."""
        face = self._faces.get(hand.name)
        if face is not None:
            u, v = (values.get(f"{hand.name} {axis}") for axis in "uv")
            now = face.coordinates(hand.p_OC_O)
            p, normal = face.place(now[0] if u is None else u, now[1] if v is None else v)
            hand = replace(hand, p_OC_O=p, normal_O=normal)
        return _turned(hand, values.get(f"{hand.name} turn", 0.0))

    def _image(self, hand: Hand, first: Hand, values: dict[str, float]) -> Hand:
        """The second hand as the image of the first."""
        assert self.mirror is not None
        normal = self.mirror.direction(first.normal_O)
        moved = replace(hand, p_OC_O=self.mirror.point(first.p_OC_O), normal_O=normal)
        return _turned(moved, -values.get(f"{first.name} turn", 0.0))


def _joint_ranges(scenario: Scenario, posture: Range) -> dict[str, Range]:
    """Ranges of the start angles that may be chosen, by revolute joint that carries a hand."""
    scene = compose(scenario).compile()
    ranges = {}
    for joint in dict.fromkeys(j for chain in chains(scene, scenario).values() for j in chain):
        known = scene.joint(joint)
        if known.type[0] != 3 or joint in scenario.robot.still:  # mjJNT_HINGE
            continue
        angle, (low, high) = scenario.robot.posture[joint], known.range.tolist()
        room = _RANGE_LEFT * (high - low)
        if not known.limited[0]:
            low, high, room = -math.pi, math.pi, 0.0
        ends = max(low + room, angle + posture[0]), min(high - room, angle + posture[1])
        ranges[joint] = (min(ends[0], angle), max(ends[1], angle))
    return ranges


def _moved(scenario: Scenario, values: dict[str, float]) -> Scenario:
    """The scenario with the robot's base elsewhere."""
    shift = np.array([values.get(f"base {axis}", 0.0) for axis in ("x", "y", "height")])
    turn = Rotation.from_rotvec([0.0, 0.0, math.radians(values.get("base yaw", 0.0))])
    base = scenario.robot.base
    point = np.asarray(scenario.path.point_W, float)
    position = point + turn.apply(np.asarray(base.position) - point) + shift
    quaternion = (turn * rotation(base)).as_quat(scalar_first=True)
    if not values.get("base yaw", 0.0):
        quaternion = np.asarray(base.quaternion)
    x, y, z = position.tolist()
    q_w, q_x, q_y, q_z = quaternion.tolist()
    moved = Pose((x, y, z), (q_w, q_x, q_y, q_z))
    return replace(scenario, robot=replace(scenario.robot, base=moved))


def _turned(hand: Hand, degrees: float) -> Hand:
    """A hand turned about its contact normal."""
    axes = contact_axes(hand.normal_O, hand.tangent_O)
    angle = math.radians(degrees)
    x, y, z = (axes @ [math.cos(angle), math.sin(angle), 0.0]).tolist()
    tangent: Vector = (x, y, z)
    return replace(hand, tangent_O=tangent) if degrees else hand
