"""Ranges of deviations and disturbances in a real cell, from which worlds are drawn by seed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.sim.model import compose, object_bounds
from fulcrum.sim.motion import Schedule
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.world.world import Push, World
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.checks import each, not_negative, whole

# Largest number of pushes in one manoeuvre; more are taken for a mistake.
_MOST_PUSHES = 1000


@dataclass(frozen=True)
class Uncertainty:
    """Ranges of a :class:`sim.world.world.World`.

    Values marked +- are half widths of uniform distributions; noises are standard deviations of
    Gaussian ones.

    Attributes:
        mass: +- share of the object's mass [-].
        center_of_mass: +- shift along each of the object's axes [m].
        size: +- share of the object's size [-].
        friction_down, friction_up: Largest shares by which friction is smaller or larger,
            independently at each pair of surfaces [-].
        hand_place: +- shift along both tangents of each hand's contact [m].
        link_mass: +- share of the mass of each driven link [-].
        joint_friction: Largest dry friction of each joint, as a share of its torque limit [-].
        torque_gain: +- share of each motor's torque [-].
        torque_offset: +- offset of each motor's torque, as a share of its limit [-].
        torque_noise: Noise of each motor's torque, as a share of its limit [-].
        encoder_noise: Noise of joint angles [rad or m].
        position_noise: Noise of the object's position, per axis [m].
        orientation_noise: Noise of the object's orientation, per axis [rad].
        latency: Latency of the outer loop [s].
        dropped: Share of the outer loop's ticks that get lost [-].
        pushes: Number of pushes while the object is held with full grip.
        push: Largest force of a push [N]; direction and place on the object are random.
        push_s: Duration of a push [s].
        stiffness_down, stiffness_up: Largest shares by which each hand's contact is softer or
            stiffer, log-uniform [-].
    """

    mass: float = 0.0
    center_of_mass: float = 0.0
    size: float = 0.0
    friction_down: float = 0.0
    friction_up: float = 0.0
    hand_place: float = 0.0
    link_mass: float = 0.0
    joint_friction: float = 0.0
    torque_gain: float = 0.0
    torque_offset: float = 0.0
    torque_noise: float = 0.0
    encoder_noise: float = 0.0
    position_noise: float = 0.0
    orientation_noise: float = 0.0
    latency: float = 0.0
    dropped: float = 0.0
    pushes: int = 0
    push: float = 0.0
    push_s: float = 0.2
    stiffness_down: float = 0.0
    stiffness_up: float = 0.0

    def __post_init__(self) -> None:
        each("uncertainty", self, not_negative)
        shares = ("mass", "size", "friction_down", "link_mass", "torque_gain", "dropped")
        for name in (*shares, "stiffness_down"):
            if not getattr(self, name) < 1.0:
                raise InvalidInputError(f"uncertainty.{name}", getattr(self, name), "in [0, 1)")
        whole("uncertainty.pushes", self.pushes, least=0)
        if self.pushes > _MOST_PUSHES:
            raise InvalidInputError("uncertainty.pushes", self.pushes, f"at most {_MOST_PUSHES}")


NOMINAL = Uncertainty()
LAB = Uncertainty(
    mass=0.10,
    center_of_mass=0.010,
    friction_down=0.15,
    friction_up=0.20,
    position_noise=0.0005,
    orientation_noise=math.radians(0.2),
    latency=0.001,
    torque_gain=0.02,
    stiffness_down=0.3,
    stiffness_up=0.4,
)
FIELD = Uncertainty(
    mass=0.20,
    center_of_mass=0.020,
    friction_down=0.20,
    friction_up=0.20,
    hand_place=0.005,
    position_noise=0.001,
    orientation_noise=math.radians(0.5),
    latency=0.002,
    dropped=0.01,
    torque_gain=0.05,
    pushes=2,
    push=5.0,
    stiffness_down=0.5,
    stiffness_up=1.0,
)
HARSH = replace(
    FIELD,
    mass=0.30,
    center_of_mass=0.030,
    friction_down=0.30,
    friction_up=0.30,
    hand_place=0.010,
    latency=0.005,
    torque_gain=0.10,
    push=10.0,
    stiffness_down=0.75,
    stiffness_up=3.0,
)
PRESETS = {"nominal": NOMINAL, "lab": LAB, "field": FIELD, "harsh": HARSH}


def preset(name: str) -> Uncertainty:
    """Return the ranges of a preset.

    Raises:
        InvalidInputError: There is none of that name.
    """
    if name not in PRESETS:
        raise InvalidInputError("preset", name, f"one of {', '.join(PRESETS)}")
    return PRESETS[name]


def draw(uncertainty: Uncertainty, scenario: Scenario, seed: int) -> World:
    """Return the world of a seed; the same arguments give the same world.

    Raises:
        InvalidInputError: The seed is negative.
    """
    whole("seed", seed, least=0)
    u, random = uncertainty, np.random.default_rng(seed)
    scene = compose(scenario).compile()
    limits = scene.actuator_ctrlrange[:, 1]
    joints, contacts = len(limits), len(scenario.contact_names)

    def within(half: float, size: int) -> Array:
        return half * random.uniform(-1.0, 1.0, size)

    # Drawn in the order of the fields. A new field goes last, else all worlds change.
    mass = 1.0 + float(within(u.mass, 1)[0])
    center = within(u.center_of_mass, 3)
    size = 1.0 + float(within(u.size, 1)[0])
    friction = 1.0 + random.uniform(-u.friction_down, u.friction_up, contacts)
    places = within(u.hand_place, 2 * len(scenario.hands)).reshape(-1, 2)
    link_mass = 1.0 + within(u.link_mass, joints)
    joint_friction = u.joint_friction * limits * random.uniform(0.0, 1.0, joints)
    gain = 1.0 + within(u.torque_gain, joints)
    offset = within(u.torque_offset, joints) * limits
    bounds = object_bounds(scenario, scene)
    pushes = tuple(_push(u, scenario, bounds, random) for _ in range(u.pushes))
    low, high = math.log(1.0 - u.stiffness_down), math.log(1.0 + u.stiffness_up)
    stiffness = np.exp(random.uniform(low, high, len(scenario.hands)))
    return World(
        seed=seed,
        mass=mass,
        center_of_mass=(float(center[0]), float(center[1]), float(center[2])),
        size=size,
        friction=_one_per_pair(scenario, friction),
        hand_place=tuple((float(t), float(o)) for t, o in places),
        link_mass=tuple(link_mass.tolist()),
        joint_friction=tuple(joint_friction.tolist()) if u.joint_friction else (),
        torque_gain=tuple(gain.tolist()),
        torque_offset=tuple(offset.tolist()),
        torque_noise=u.torque_noise,
        encoder_noise=u.encoder_noise,
        position_noise=u.position_noise,
        orientation_noise=u.orientation_noise,
        latency=u.latency,
        dropped=u.dropped,
        pushes=pushes,
        stiffness=tuple(stiffness.tolist()),
    )


def _one_per_pair(scenario: Scenario, friction: Array) -> tuple[float, ...]:
    """Return the friction factors, with that of the first contact for all of the same surfaces."""
    pairs = [(hand.name, hand.geom) for hand in scenario.hands]
    pairs += [(support.surface, support.geom) for support in scenario.supports]
    return tuple(float(friction[pairs.index(pair)]) for pair in pairs)


def _push(
    u: Uncertainty,
    scenario: Scenario,
    bounds: tuple[Array, Array],
    random: np.random.Generator,
) -> Push:
    """Return a push with random time in the hold, direction, and place in the object's bounds."""
    schedule = Schedule(scenario)
    held = np.flatnonzero(schedule.held)
    first, last = (schedule.starts[held[0]], schedule.ends[held[-1]]) if len(held) else (0.0, 0.0)
    t = float(random.uniform(first, last))
    direction = random.normal(size=3)
    force = u.push * random.uniform() * direction / np.linalg.norm(direction)
    x, y, z = force.tolist()
    a, b, c = random.uniform(*bounds).tolist()
    return Push(t, u.push_s, (x, y, z), (a, b, c))
