"""One world: deviations of the plant from the scenario, and disturbances.

They affect only plant, sensors and transmission; the controller uses the scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.sim.geometry import Geom, Object, triple
from fulcrum.sim.model import contact_axes
from fulcrum.sim.scenario import Friction, Hand, Rest, Scenario, Support
from fulcrum.sim.world.faults import Fault
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Vector
from fulcrum.synthesis.checks import finite, not_negative, positive, vector


@dataclass(frozen=True)
class Push:
    """A force on the object for a limited time, as when a person bumps into it.

    Attributes:
        t: Start [s].
        duration_s: Duration [s].
        force_W: Force in world axes [N].
        p_OA_O: Point of application in the object frame [m].
    """

    t: float
    duration_s: float
    force_W: Vector
    p_OA_O: Vector

    def __post_init__(self) -> None:
        not_negative("push.t", self.t)
        positive("push.duration_s", self.duration_s)
        vector("push.force_W", self.force_W, 3)
        vector("push.p_OA_O", self.p_OA_O, 3)


@dataclass(frozen=True)
class World:
    """Deviations of the truth from a scenario, and disturbances; none by default.

    Empty tuples mean no deviation.

    Attributes:
        seed: Seed of noise and dropped ticks.
        mass: Factor on the object's mass [-].
        center_of_mass: Shift of the object's centre of mass, in the object frame [m].
        size: Factor on the object's size about its pivot [-]; its edges and faces move with it.
        friction: Factors on the friction of each contact, hands first [-], (m,).
        hand_place: Shift along (t, o) of each hand's tip from its nominal place on the wrist [m],
            (n, 2). The contact on the object is shifted by the same distance.
        link_mass: Factors on mass and inertia of the link behind each driven joint [-], (l,).
        joint_friction: Dry friction of each driven joint [N·m or N], (l,).
        torque_gain: Factor on each commanded torque [-], (l,).
        torque_offset: Offset of each motor's torque [N·m or N], (l,).
        torque_noise: Standard deviation of each motor's torque at every physics step, as a share
            of its limit [-].
        encoder_noise: Standard deviation of the angles that the controller sees [rad or m].
        position_noise: Standard deviation of the object's position, per axis, at every step [m].
        orientation_noise: Standard deviation of the object's orientation, per axis, at every step
            [rad].
        latency: Time from measurement to effect of the outer loop [s].
        dropped: Share of the outer loop's ticks whose results get lost [-].
        pushes: Forces on the object.
        obstacles: Geoms in the world that the scenario's environment does not contain.
        faults: Faults during the run.
        stiffness: Factors on the stiffness of each hand's contact [-], (n,).
    """

    seed: int = 0
    mass: float = 1.0
    center_of_mass: Vector = (0.0, 0.0, 0.0)
    size: float = 1.0
    friction: tuple[float, ...] = ()
    hand_place: tuple[tuple[float, float], ...] = ()
    link_mass: tuple[float, ...] = ()
    joint_friction: tuple[float, ...] = ()
    torque_gain: tuple[float, ...] = ()
    torque_offset: tuple[float, ...] = ()
    torque_noise: float = 0.0
    encoder_noise: float = 0.0
    position_noise: float = 0.0
    orientation_noise: float = 0.0
    latency: float = 0.0
    dropped: float = 0.0
    pushes: tuple[Push, ...] = ()
    obstacles: tuple[Geom, ...] = ()
    faults: tuple[Fault, ...] = ()
    stiffness: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise InvalidInputError("world.seed", self.seed, "an integer >= 0")
        positive("world.mass", self.mass)
        if not 1e-3 <= self.size <= 1e3:  # its square must be a finite number
            raise InvalidInputError("world.size", self.size, "in [0.001, 1000]")
        vector("world.center_of_mass", self.center_of_mass, 3)
        for name in ("friction", "link_mass", "torque_gain", "stiffness"):
            for factor in getattr(self, name):
                positive(f"world.{name}", factor)
        for friction in self.joint_friction:
            not_negative("world.joint_friction", friction)
        finite("world.torque_offset", self.torque_offset)
        for place in self.hand_place:
            vector("world.hand_place", place, 2)
        for name in ("torque_noise", "encoder_noise", "position_noise", "orientation_noise"):
            not_negative(f"world.{name}", getattr(self, name))
        not_negative("world.latency", self.latency)
        if not 0.0 <= self.dropped < 1.0:
            raise InvalidInputError("world.dropped", self.dropped, "in [0, 1)")

    def check_joints(self, joints: Sequence[str]) -> None:
        """Refuse a world that does not fit these driven joints.

        Raises:
            InvalidInputError: A tuple has another length, or a fault names another joint.
        """
        for name in ("link_mass", "joint_friction", "torque_gain", "torque_offset"):
            _check_length(name, getattr(self, name), len(joints))
        for fault in self.faults:
            if fault.joint and fault.joint not in joints:
                raise InvalidInputError("fault.joint", fault.joint, f"one of {', '.join(joints)}")

    def truth(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the true object, contacts and rests.

        Raises:
            InvalidInputError: A tuple has another length than the scenario requires.
        """
        n, contacts = len(scenario.hands), len(scenario.contact_names)
        _check_length("friction", self.friction, contacts)
        _check_length("hand_place", self.hand_place, n)
        _check_length("stiffness", self.stiffness, n)
        friction = self.friction or (1.0,) * contacts
        places = self.hand_place or ((0.0, 0.0),) * n
        stiffness = self.stiffness or (1.0,) * n
        hands = tuple(map(self._hand, scenario.hands, friction[:n], places, stiffness))
        supports = tuple(map(self._support, scenario.supports, friction[n:]))
        return replace(
            scenario,
            object=self._object(scenario.object),
            environment=(*scenario.environment, *self.obstacles),
            hands=hands,
            supports=supports,
            rests=tuple(_rest(rest, supports) for rest in scenario.rests),
            path=scenario.path.scaled(self.size),
        )

    def _object(self, thing: Object) -> Object:
        geoms = tuple(
            replace(
                geom,
                size=tuple(self.size * size for size in geom.size),
                pose=replace(geom.pose, position=_scaled(self.size, geom.pose.position)),
            )
            for geom in thing.geoms
        )
        center = self.size * np.asarray(thing.center_of_mass) + self.center_of_mass
        return replace(
            thing,
            mass=self.mass * thing.mass,
            inertia=_scaled(self.mass * self.size**2, thing.inertia),
            geoms=geoms,
            center_of_mass=triple(center),
            shape=None if thing.shape is None else thing.shape.scaled(self.size),
        )

    def _hand(
        self, hand: Hand, friction: float, place: tuple[float, float], stiffness: float
    ) -> Hand:
        p_OC_O = self.size * np.asarray(hand.p_OC_O)
        p_OC_O += contact_axes(hand.normal_O, hand.tangent_O)[:, :2] @ place
        return replace(
            hand,
            friction=_slipperier(hand.friction, friction),
            p_OC_O=triple(p_OC_O),
            material=hand.material.scaled(stiffness),
        )

    def _support(self, support: Support, friction: float) -> Support:
        return replace(
            support,
            friction=_slipperier(support.friction, friction),
            p_OP_O=_scaled(self.size, support.p_OP_O),
        )


# The world without deviations and disturbances.
NO_DEVIATION = World()


def _check_length(name: str, values: tuple, length: int) -> None:
    if values and len(values) != length:
        raise InvalidInputError(f"world.{name}", f"{len(values)} values", f"none or {length}")


def _slipperier(friction: Friction, factor: float) -> Friction:
    return replace(friction, mu=factor * friction.mu)


def _rest(rest: Rest, supports: tuple[Support, ...]) -> Rest:
    """Return a rest with the friction of the supports on the same pair of geoms, if any."""
    for support in supports:
        if (support.geom, support.surface) == (rest.geom, rest.surface):
            return replace(rest, friction=support.friction)
    return rest


def _scaled(factor: float, vector: Vector) -> Vector:
    x, y, z = vector
    return (factor * x, factor * y, factor * z)
