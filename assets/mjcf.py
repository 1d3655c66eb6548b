"""Conversion of any robot's MJCF to the form of those that ship: the robot alone, with motors.

Elements that belong to the scene (floor, lights, cameras, options, keyframes) or to another
controller (actuators, sensors, tendons, equalities) are removed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import mujoco
import numpy as np

from fulcrum.assets.packages import ModelError

LOOKS = 2
"""Group of visual geoms, by the convention of MJCF."""
SOLID = 3
"""Group of the geoms that may touch, in a robot with visual geoms."""
_JOINT = mujoco.mjtTrn.mjTRN_JOINT
# Main defaults of a file that would apply to elements of the scene.
_DEFAULTS = {
    "geom": "type size pos quat group margin gap condim priority friction solmix solref solimp "
    "density mass rgba",
    "joint": "armature damping frictionloss stiffness",
    "pair": "margin gap adhesion",
    "light": "pos dir ambient diffuse specular",
}


def tidy(spec: mujoco.MjSpec) -> None:
    """Keep only the robot, with a motor at each joint.

    A motor's range is the narrowest of joint (``actuatorfrcrange``) and actuators (``forcerange``,
    or a motor's ``ctrlrange``); without any of them it has none. Geoms keep their shapes and touch
    nothing unless paired. Bodies and geoms without a name get one. Springs and dry friction of
    joints are kept, although the robot model has neither.

    Raises:
        ModelError: MuJoCo does not compile it, or the robot model does not support a joint.
    """
    try:
        model = spec.compile()
    except ValueError as error:
        raise ModelError(str(error), "a model that MuJoCo compiles") from None
    _check_joints(model)
    motors = _motors(model, [joint.name for joint in spec.joints if joint.name])
    is_looks = _looks(model)
    for elements in _beside(spec):
        for element in list(elements):
            spec.delete(element)
    for name, limits in motors.items():
        motor = spec.add_actuator(name=name, target=name, trntype=_JOINT)
        motor.set_to_motor()
        motor.gear = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_AUTO
        motor.ctrlrange = motor.forcerange = [0.0, 0.0]
        if np.isfinite(limits).all():
            motor.ctrlrange = limits
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
        if any(is_looks):
            geom.group = LOOKS if is_looks[geom.id] else SOLID
    for geom in list(spec.worldbody.geoms):
        spec.delete(geom)
    for body in spec.bodies[1:]:
        body.gravcomp = 0.0
    _name(spec)
    _forget_defaults(spec)


def _check_joints(model: mujoco.MjModel) -> None:
    for j in range(model.njnt):
        kind, name = mujoco.mjtJoint(model.jnt_type[j]), model.joint(j).name or f"number {j}"
        if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            given = f"joint {name} of type {kind.name.removeprefix('mjJNT_').lower()}"
            raise ModelError(given, "a robot on a fixed base with hinges and slides")
        if model.qpos0[model.jnt_qposadr[j]] != 0.0:
            raise ModelError(f"joint {name} with a ref", "a joint whose ref is 0")


def _motors(model: mujoco.MjModel, joints: list[str]) -> dict[str, tuple[float, float]]:
    """Return least and largest torque or force by joint, joints with an actuator first."""
    driven = [i for i in range(model.nu) if _drives_a_joint(model, i)]
    driven_joints = [model.joint(model.actuator_trnid[i, 0]).name for i in driven]
    ranges = dict.fromkeys([*driven_joints, *joints], (-np.inf, np.inf))
    for name, (low, high) in _limits(model):
        if name in ranges:
            ranges[name] = (max(ranges[name][0], low), min(ranges[name][1], high))
    return ranges


def _limits(model: mujoco.MjModel) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield all limits of torques or forces in a model, each with the name of its joint."""
    for j in range(model.njnt):
        if model.jnt_actfrclimited[j]:
            yield model.joint(j).name, tuple(model.jnt_actfrcrange[j].tolist())
    for i in range(model.nu):
        if not _drives_a_joint(model, i):
            continue
        name, gear = model.joint(model.actuator_trnid[i, 0]).name, model.actuator_gear[i, 0]
        is_motor = (
            model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_NONE
            and model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
            and model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
        )
        if model.actuator_forcelimited[i]:
            yield name, _in_order(gear * model.actuator_forcerange[i])
        if is_motor and model.actuator_ctrllimited[i]:
            gain = model.actuator_gainprm[i, 0]
            yield name, _in_order(gear * gain * model.actuator_ctrlrange[i])


def _drives_a_joint(model: mujoco.MjModel, actuator: int) -> bool:
    kind = mujoco.mjtTrn(model.actuator_trntype[actuator])
    return kind in (_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def _in_order(limits: np.ndarray) -> tuple[float, float]:
    low, high = sorted(limits.tolist())
    return low, high


def _looks(model: mujoco.MjModel) -> list[bool]:
    """Return which geoms are visual: those that touch nothing, if others touch."""
    touches = (model.geom_contype | model.geom_conaffinity) != 0
    return (~touches).tolist() if touches.any() else [False] * model.ngeom


def _beside(spec: mujoco.MjSpec) -> Iterator[Iterable]:
    """Yield the elements outside the robot, those that refer to others first."""
    yield from (spec.keys, spec.sensors, spec.actuators, spec.equalities, spec.tendons)
    yield from (spec.pairs, spec.excludes, spec.tuples, spec.skins, spec.flexes)
    yield from (spec.cameras, spec.lights, spec.texts, spec.numerics)


def _name(spec: mujoco.MjSpec) -> None:
    """Name bodies and geoms without a name, so that pairs and messages can refer to them."""
    bodies = {body.name for body in spec.bodies}
    for body in spec.bodies[1:]:
        body.name = body.name or _unused(f"{body.parent.name}_part", bodies)
    geoms = {geom.name for geom in spec.geoms}
    for body in spec.bodies[1:]:
        for geom in body.geoms:
            geom.name = geom.name or _unused(body.name, geoms)


def _unused(name: str, used: set[str]) -> str:
    """Return the name, with a number if it is used, and mark it as used."""
    names = (name, *(f"{name}_{i}" for i in range(1, len(used) + 1)))
    new = next(n for n in names if n not in used)
    used.add(new)
    return new


def _forget_defaults(spec: mujoco.MjSpec) -> None:
    """Reset main defaults and options, which the scene would inherit from the robot."""
    stock = mujoco.MjSpec()
    for kind, names in _DEFAULTS.items():
        ours, theirs = getattr(spec.default, kind), getattr(stock.default, kind)
        for name in names.split():
            value = getattr(theirs, name)
            setattr(ours, name, value.copy() if isinstance(value, np.ndarray) else value)
    for name in (name for name in dir(stock.option) if not name.startswith("_")):
        setattr(spec.option, name, getattr(stock.option, name))
