"""Composes a MuJoCo scene from a scenario's data: robots, hands, object, environment, contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fulcrum.assets.models import hand_spec, robot_spec
from fulcrum.assets.packages import ModelError
from fulcrum.sim.geometry import GRAVITY, Geom, read_mesh
from fulcrum.sim.model.contacts import check_contacts
from fulcrum.sim.model.links import is_solid, link_pairs
from fulcrum.sim.model.object_path import check_supports
from fulcrum.sim.model.stiffness import specify_stiffness
from fulcrum.sim.scenario import ContactMaterial, Friction, Hand, Robot, Scenario
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array

# Tolerance of the main and the noslip solver; tight, since runs are compared bit by bit.
_SOLVER_TOLERANCE = 1e-10

_GEOM_TYPES = {
    kind: getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")
    for kind in ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
}


class ObjectMotion(StrEnum):
    """Motion of the object: free by physics, or posed by the caller (inverse kinematics)."""

    FREE = "free"
    POSED = "posed"


def compose(scenario: Scenario, motion: ObjectMotion = ObjectMotion.FREE) -> mujoco.MjSpec:
    """Return the scene as an editable specification.

    Raises:
        InvalidInputError: The scenario names a joint, mount, part of a hand or geom type that does
            not exist, or a start angle outside its joint's range, or MuJoCo refuses the scene.
    """
    check_contacts(scenario)
    check_supports(scenario)
    spec = _robots(scenario)
    for hand in scenario.hands:
        _add_hand(spec, hand)
    spec.modelname = scenario.name
    _set_options(spec, scenario)
    for geom in scenario.environment:
        _add_geom(spec, spec.worldbody, geom)
    _add_object(spec, scenario, motion)
    if motion is ObjectMotion.FREE:
        _add_pairs(spec, scenario)
    scene = _compiled(spec)
    if motion is ObjectMotion.FREE:
        specify_stiffness(spec, scene, pair_materials(scenario))
        data = mujoco.MjData(scene)
        for name, angle in scenario.posture.items():
            data.joint(name).qpos[:] = angle
        mujoco.mj_kinematics(scene, data)
        unwanted = unwanted_pairs(scenario, scene) + object_pairs(scenario)
        for first, second in unwanted + link_pairs(scenario, scene, data):
            spec.add_pair(geomname1=first, geomname2=second)
    _add_view(spec, scenario)
    return spec


def _compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    try:
        return spec.copy().compile()
    except ValueError as error:
        given = " ".join(str(error).split())
        raise InvalidInputError("scene", given, "one that MuJoCo compiles") from None


def hand_body(hand: Hand) -> str:
    """Return the name of the body of a hand."""
    return f"{hand.name}_pad"


def tip_geom(hand: Hand) -> str:
    """Return the name of the geom with which a hand touches."""
    return f"{hand.name}_tip"


def tip_site(hand: Hand) -> str:
    """Return the name of the site at the centre of a hand's tip."""
    return f"{hand.name}_tip_center"


def unwanted_pairs(scenario: Scenario, scene: mujoco.MjModel) -> list[tuple[str, str]]:
    """Return the pairs of moving links and solid geoms of object or environment, by name.

    These must not touch.
    """
    surroundings = {g.name: g for g in (*scenario.object.geoms, *scenario.environment)}
    touching = {(tip_geom(hand), hand.geom) for hand in scenario.hands}
    geoms = [scene.geom(g) for g in range(scene.ngeom)]
    links = [g.name for g in geoms if scene.body_weldid[g.bodyid[0]] != 0 and is_solid(g)]
    return [
        (link, other)
        for link in links
        for other in surroundings
        if link not in surroundings and (link, other) not in touching and surroundings[other].solid
    ]


def object_pairs(scenario: Scenario) -> list[tuple[str, str]]:
    """Return the pairs of geoms of object and environment that must not touch, by name.

    A surface that a support or rest names may be touched by all geoms of the object.
    """
    named = {s.surface for s in scenario.supports} | {r.surface for r in scenario.rests}
    return [
        (own.name, other.name)
        for other in scenario.environment
        if other.solid and other.name not in named
        for own in scenario.object.geoms
        if own.solid
    ]


def joint_ranges(scene: mujoco.MjModel) -> NDArray[np.float64]:
    """Return lower and upper joint limits [rad or m], (njnt, 2); infinite where there are none."""
    limited = scene.jnt_limited[:, None].astype(bool)
    return np.where(limited, scene.jnt_range, [-np.inf, np.inf])


def object_bounds(scenario: Scenario, scene: mujoco.MjModel) -> tuple[Array, Array]:
    """Return two opposite corners, (3,), of the bounds of the object's geoms, in its frame [m]."""
    corners = []
    for name in (geom.name for geom in scenario.object.geoms):
        geom = scene.geom(name)
        center, half = scene.geom_aabb[geom.id].reshape(2, 3)
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, geom.quat)
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        corners.append(geom.pos + (center + signs * half) @ R.reshape(3, 3).T)
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)


def _set_options(spec: mujoco.MjSpec, scenario: Scenario) -> None:
    physics, option = scenario.physics, spec.option
    option.timestep = physics.timestep
    option.gravity = [0.0, 0.0, -GRAVITY]
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.impratio = physics.impratio
    option.noslip_iterations = physics.noslip_iterations
    option.tolerance = option.noslip_tolerance = _SOLVER_TOLERANCE


def _robots(scenario: Scenario) -> mujoco.MjSpec:
    """Return the specification of all robots, those with a prefix attached to the one without."""
    spec = mujoco.MjSpec()
    for robot in sorted(scenario.robots, key=lambda robot: robot.prefix != ""):
        own = _robot(robot)
        if robot.prefix:
            own.default.name = "robot"  # the default class of hands has the name "main", too
            spec.attach(own, prefix=robot.prefix, frame=spec.worldbody.add_frame())
        else:
            spec = own
    return spec


def _robot(robot: Robot) -> mujoco.MjSpec:
    """Return one robot at its base, with motors at the driven joints and the others locked."""
    spec = _read(f"{robot.label}.model", robot_spec, robot.model)
    _check_joints(spec, robot)
    for actuator in list(spec.actuators):
        name = actuator.target
        if name not in robot.posture:
            spec.delete(actuator)
            continue
        low, high = actuator.ctrlrange
        limit = robot.torque_limits.get(name, math.inf)
        if low == high == 0.0:  # the model states none
            low, high = -math.inf, math.inf
        low, high = max(low, -limit), min(high, limit)
        if not high > low > -math.inf:
            field = f"{robot.label}.torque_limits.{name}"
            raise InvalidInputError(field, "none, here or in the model", "a number > 0 [N m or N]")
        actuator.ctrlrange = [low, high]
    for joint in list(spec.joints):
        if joint.name not in robot.posture:
            spec.delete(joint)
            continue
        stated = [speed for speed in [*joint.userdata][:1] if 0.0 < speed < math.inf]
        speeds = [*stated, *(s for n, s in robot.speed_limits.items() if n == joint.name)]
        if not speeds:
            field = f"{robot.label}.speed_limits.{joint.name}"
            valid = "a number > 0 [rad/s or m/s]"
            raise InvalidInputError(field, "none, here or in the model", valid)
        joint.userdata = [min(speeds)]
    base = robot.base
    for root in spec.worldbody.bodies:
        position, quaternion = np.zeros(3), np.zeros(4)
        mujoco.mju_mulPose(
            position, quaternion, base.position, base.quaternion, root.pos, root.quat
        )
        root.pos, root.quat = position, quaternion
    return spec


def _read(field: str, read: Callable[[str], mujoco.MjSpec], model: str) -> mujoco.MjSpec:
    try:
        return read(model)
    except ModelError as error:
        raise InvalidInputError(field, error.given, error.valid) from None


def _check_joints(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Refuse joints that do not exist, and start angles outside a joint's range."""
    model = spec.copy().compile()
    known = [name for j in range(model.njnt) if (name := model.joint(j).name)]
    for field in ("posture", "torque_limits", "speed_limits"):
        for name in getattr(robot, field):
            if name not in known:
                valid = f"one of {', '.join(known)}"
                raise InvalidInputError(f"{robot.label}.{field}", name, valid)
    for name, angle in robot.posture.items():
        low, high = model.joint(name).range
        if model.joint(name).limited[0] and not low <= angle <= high:
            valid = f"in [{low:g}, {high:g}]"
            raise InvalidInputError(f"{robot.label}.posture.{name}", angle, valid)


def _add_hand(spec: mujoco.MjSpec, hand: Hand) -> None:
    mount = spec.body(hand.mount)
    if mount is None:
        bodies = ", ".join(body.name for body in spec.bodies)
        raise InvalidInputError(f"{hand.name}.mount", hand.mount, f"one of {bodies}")
    model = _read(f"{hand.name}.model", hand_spec, hand.model)
    for kind, part in (("body", "pad"), ("geom", "tip"), ("site", "tip_center")):
        if getattr(model, kind)(part) is None:
            raise InvalidInputError(f"{hand.name}.model", hand.model, f"one with a {kind} {part}")
    frame = mount.add_frame(pos=hand.mount_pose.position, quat=hand.mount_pose.quaternion)
    frame.attach_body(model.body("pad"), f"{hand.name}_", "")


def _add_geom(spec: mujoco.MjSpec, body: mujoco.MjsBody, geom: Geom) -> None:
    if geom.kind not in _GEOM_TYPES:
        raise InvalidInputError(f"{geom.name}.kind", geom.kind, f"one of {', '.join(_GEOM_TYPES)}")
    shape: dict[str, Any] = {"size": [*geom.size, 0.0, 0.0][:3]}
    if geom.file is not None:
        read = read_mesh(f"{geom.name}.file", geom.file, geom.size)
        spec.add_mesh(name=geom.name, uservert=read.vertices.ravel(), userface=read.faces.ravel())
        shape = {"meshname": geom.name}
    body.add_geom(
        name=geom.name,
        type=_GEOM_TYPES[geom.kind],
        **shape,
        pos=geom.pose.position,
        quat=geom.pose.quaternion,
        rgba=geom.rgba,
        mass=0.0,
        contype=0,
        conaffinity=0,
    )


def _add_object(spec: mujoco.MjSpec, scenario: Scenario, motion: ObjectMotion) -> None:
    thing, start = scenario.object, scenario.path.start
    body = spec.worldbody.add_body(
        name=thing.name,
        pos=start.position,
        quat=start.quaternion,
        mass=thing.mass,
        ipos=thing.center_of_mass,
        iquat=thing.principal_axes,
        inertia=thing.inertia,
        explicitinertial=True,
        mocap=motion is ObjectMotion.POSED,
    )
    if motion is ObjectMotion.FREE:
        body.add_freejoint(name=thing.name)
    for geom in thing.geoms:
        _add_geom(spec, body, geom)


def pair_materials(scenario: Scenario) -> dict[str, ContactMaterial]:
    """Return the materials of the pairs that may touch, by the pair's name."""
    return {_pair_name(*pair): material for pair, (_, material) in _wanted_pairs(scenario).items()}


def _wanted_pairs(
    scenario: Scenario,
) -> dict[tuple[str, str], tuple[Friction, ContactMaterial]]:
    """Return friction and material of each pair of geoms that may touch.

    The geom of the hand or of the surface is the first of its pair.

    Raises:
        InvalidInputError: Contacts of the same pair contradict each other.
    """
    wanted = {(tip_geom(h), h.geom): (h.friction, h.material) for h in scenario.hands}
    placed = [(s.name, s.surface, s.geom, s.friction, s.material) for s in scenario.supports]
    placed += [("rest", r.surface, r.geom, r.friction, r.material) for r in scenario.rests]
    for name, surface, geom, friction, material in placed:
        known = wanted.setdefault((surface, geom), (friction, material))
        for field, given, other in zip(
            ("friction", "material"), (friction, material), known, strict=True
        ):
            if given != other:
                valid = f"{other}, as at other contacts of {geom} on {surface}"
                raise InvalidInputError(f"{name}.{field}", given, valid)
    return wanted


def _pair_name(first: str, second: str) -> str:
    return f"{first}-{second}"


def _add_pairs(spec: mujoco.MjSpec, scenario: Scenario) -> None:
    """Add contact pairs with the scenario's friction.

    Without a pair, MuJoCo uses the larger friction of the two geoms. An elliptic cone with condim 4
    is exactly SFCE, (2) of the paper; with condim 3 it is PCWF, (1).
    """
    for (first, second), (friction, _) in _wanted_pairs(scenario).items():
        torsion = 0.0 if friction.e_n is None else friction.mu * friction.e_n
        spec.add_pair(
            name=_pair_name(first, second),
            geomname1=first,
            geomname2=second,
            condim=3 if friction.e_n is None else 4,
            friction=[friction.mu, friction.mu, torsion, 0.0, 0.0],
        )


def _add_view(spec: mujoco.MjSpec, scenario: Scenario) -> None:
    """Add lights and a camera for MuJoCo's own viewer."""
    spec.worldbody.add_light(pos=[0.0, -1.5, 2.5], dir=[0.2, 0.6, -1.0])
    spec.worldbody.add_light(pos=[1.5, 1.5, 2.5], dir=[-0.4, -0.5, -1.0])
    spec.stat.center = scenario.path.point_W
    spec.stat.extent = 1.0
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
