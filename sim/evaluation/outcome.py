r"""The outcome of a run, measured from the motion of the object alone.

Speeds and distances of the object are root mean squares over its mass, :math:`v^2 = 2 T / m` with
the kinetic energy T, so that they include rotation. The bounds:

- An object *falls* if it moves faster than 0.15 m/s, both relative to the commanded motion and in
  the world. Free fall from 1.1 mm reaches this speed. In runs of three scenes by all controllers in
  worlds of all presets, with faults and planned tilts, objects that stayed in the hands or on their
  support moved with at most 0.07 m/s, and those that fell with at least 0.21 m/s.
- It is *at rest* if its mean speed over the last 0.1 s is below 20 mm/s. At the end of a run the
  object should rest; held objects moved with at most 1.2 mm/s.
- It is *at a pose* if the distance of its mass to that pose is at most a fifth of its radius of
  gyration (about 20 mm for a crate 0.3 m long), and the difference of the tilts is at most the
  tolerance for disturbed runs. Objects that were set down or lowered were off by at most 0.09
  radii.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from fulcrum.sim.geometry import Object
from fulcrum.sim.model import ObjectPath, rotations
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis.arrays import Array

# Speed of a falling object [m/s].
_FALLING = 0.15
# Speed of an object at rest [m/s], and the time over which it is averaged [s].
_REST, _REST_S = 0.02, 0.1
# Allowed distance of the mass, as a share of the radius of gyration [-].
_OFF = 0.2
# Time between checks of the object's speed [s]; free fall gains 0.1 m/s in this time.
_LOOK_S = 0.01


class Outcome(StrEnum):
    """The final state of the object.

    ``completed``: it rests at the end of the manoeuvre. ``returned``: it has not fallen and rests
    on the path at another tilt, where it was lowered or held, or it never moved. ``dropped``: it
    fell, toppled, slid away or was let go. ``refused``: the run was not begun; nothing has moved.
    ``interrupted``, ``diverged``: the run ended early.
    """

    COMPLETED = "completed"
    RETURNED = "returned"
    DROPPED = "dropped"
    REFUSED = "refused"
    INTERRUPTED = "interrupted"
    DIVERGED = "diverged"


def measured_outcome(scenario: Scenario, trace: Trace) -> Outcome:
    """Return the final state of the object in a run that was not cut short.

    Args:
        scenario: True scenario, as the plant has it.
        trace: Trace of the run, at least one step.
    """
    path, thing = object_path(scenario.path), scenario.object
    if fall_speed(path, thing, trace, scenario.physics.timestep) > _FALLING:
        return Outcome.DROPPED
    last = trace.t > trace.t[-1] - _REST_S
    mean = _of_center(thing, trace.quat_WO[last], trace.twist_WO[last]).mean(axis=0)
    if _speeds(thing, trace.quat_WO[-1:], mean[None])[0] > _REST:
        return Outcome.DROPPED
    tilt = float(trace.tilt[-1])
    if not math.isfinite(tilt):
        return Outcome.DROPPED
    target = math.radians(scenario.path.angle_deg) * scenario.phases[-1].tilt
    near = math.degrees(abs(tilt - target)) <= scenario.tolerances.disturbed.final_deg
    # The measured tilt may lie beyond the ends of the path.
    on_path = target if near else min(max(tilt, 0.0), path.end)
    if distance_off(scenario, trace, on_path) > _OFF * gyration(thing):
        return Outcome.DROPPED
    return Outcome.COMPLETED if near else Outcome.RETURNED


def gyration(thing: Object) -> float:
    """Return the radius of gyration of an object about its centre of mass [m]."""
    return math.sqrt(0.5 * sum(thing.inertia) / thing.mass)


def fall_speed(path: ObjectPath, thing: Object, trace: Trace, timestep: float) -> float:
    """Return the largest speed of the object's mass away from the commanded motion [m/s].

    An object that rests while the arms move on does not fall: the smaller one of the speed relative
    to the commanded motion and the speed in the world counts.
    """
    looks = trace.pick(np.arange(0, len(trace), max(1, round(_LOOK_S / timestep))))
    center = np.asarray(thing.center_of_mass)
    commanded = np.zeros_like(looks.twist_WO)
    for row, (tilt, rate) in enumerate(zip(looks.tilt_ref, looks.rate_ref, strict=True)):
        if rate != 0.0:
            commanded[row, :3] = rate * path.derivatives(float(tilt), center)[0]
            commanded[row, 3:] = rate * path.axis(float(tilt))
    twist = _of_center(thing, looks.quat_WO, looks.twist_WO)
    away = _speeds(thing, looks.quat_WO, twist - commanded)
    return float(np.minimum(away, _speeds(thing, looks.quat_WO, twist)).max())


def _of_center(thing: Object, quat_WO: Array, twist_WO: Array) -> Array:
    """Return twists of the centre of mass from those of the object's frame, (k, 6), world axes."""
    moved = twist_WO.copy()
    moved[:, :3] += np.cross(twist_WO[:, 3:], rotations(quat_WO) @ np.asarray(thing.center_of_mass))
    return moved


def _speeds(thing: Object, quat_WO: Array, twist: Array) -> Array:
    """Return speeds of the mass [m/s], (k,), from twists of the centre of mass, (k, 6)."""
    spin_O = np.einsum("kji,kj->ki", rotations(quat_WO), twist[:, 3:])
    turning = np.einsum("ki,ij,kj->k", spin_O, thing.inertia_O, spin_O) / thing.mass
    return np.sqrt(np.sum(twist[:, :3] ** 2, axis=1) + turning)


def distance_off(scenario: Scenario, trace: Trace, tilt: float) -> float:
    """Return the final distance [m] of the object's mass to the pose at a tilt in radians."""
    thing = scenario.object
    R_WO, p_WO = object_path(scenario.path).pose(tilt)
    (R_end,) = rotations(trace.quat_WO[-1:])
    center = np.asarray(thing.center_of_mass)
    off = trace.p_WO[-1] + R_end @ center - p_WO - R_WO @ center
    # A rotation D moves mass points by (D - 1) r; the mean square is 2 tr((1 - D) S), with the
    # second moments S of the mass.
    inertia = thing.inertia_O / thing.mass
    moments = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    turned = 2.0 * float(np.trace((np.eye(3) - R_WO.T @ R_end) @ moments))
    return math.sqrt(max(0.0, float(off @ off) + turned))
