"""Mirror symmetry of a scene: two hands face to face, on chains that mirror each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from fulcrum.sim.geometry import triple
from fulcrum.sim.model import ContactFrames, ObjectPath, compose, hand_body
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.scenario import Hand, Scenario
from fulcrum.synthesis.arrays import Array, Vector

# Tolerance of places and directions, as robot descriptions contain rounded numbers [m or -].
_ALIKE = 1e-3
# Number of tilts at which the path is checked.
_LOOKS = 7


@dataclass(frozen=True, eq=False)
class Mirror:
    """The vertical plane that maps one hand, and its chain of joints, to the other.

    Attributes:
        hands: The two hands; the second is the image of the first.
        normal_W, point_W: Unit normal of the plane, and a point on it [m], in the world, (3,) each.
        normal_O, point_O: Both in the object's frame, (3,) each.
        joints: Image in the second chain and sign of its angle, by joint of the first chain.
    """

    hands: tuple[Hand, Hand]
    normal_W: Array
    point_W: Array
    normal_O: Array
    point_O: Array
    joints: dict[str, tuple[str, float]]

    def point(self, p_O: Vector) -> Vector:
        """Return the image of a point in the object's frame [m], (3,)."""
        p = np.asarray(p_O, float)
        return triple(p - _twice(p - self.point_O, self.normal_O))

    def direction(self, v_O: Vector) -> Vector:
        """Return the image of a direction in the object's frame, (3,)."""
        v = np.asarray(v_O, float)
        return triple(v - _twice(v, self.normal_O))


def chains(scene: mujoco.MjModel, scenario: Scenario) -> dict[str, tuple[str, ...]]:
    """Return the names of the driven joints that carry a hand, from the root, by hand."""
    found = {}
    for hand in scenario.hands:
        names: list[str] = []
        body = int(scene.body(hand_body(hand)).id)
        while body:
            first, count = int(scene.body_jntadr[body]), int(scene.body_jntnum[body])
            names = [scene.joint(j).name for j in range(first, first + count)] + names
            body = int(scene.body_parentid[body])
        found[hand.name] = tuple(names)
    return found


def find_mirror(scenario: Scenario) -> Mirror | None:
    """Return the mirror symmetry of a scene's hands; None if there is none normal to world x or y.

    Surroundings and joint limits are not checked. If they are not symmetric, the image of a good
    placement may be a bad one; the search then rejects it.
    """
    if len(scenario.hands) != 2:
        return None
    first, second = scenario.hands
    path, frames = object_path(scenario.path), ContactFrames(scenario)
    R_WO, p_WO = path.pose(0.0)
    points = frames.points(R_WO, p_WO)[:2]
    across, normal = points[0] - points[1], np.zeros(3)
    normal[int(np.abs(across).argmax())] = 1.0
    center = points.mean(axis=0)
    normal_O, point_O = R_WO.T @ normal, R_WO.T @ (center - p_WO)
    p = np.asarray(scenario.object.center_of_mass)
    flat = abs(normal[2]) < _ALIKE and abs(normal_O @ (p - point_O)) < _ALIKE
    if not (flat and first.friction == second.friction and _stays(path, normal)):
        return None
    mirror = Mirror((first, second), normal, center, normal_O, point_O, {})
    images = (
        (mirror.point(first.p_OC_O), second.p_OC_O),
        (mirror.direction(first.normal_O), second.normal_O),
    )
    if not all(np.allclose(a, b, rtol=0.0, atol=_ALIKE) for a, b in images):
        return None
    joints = _images(scenario, normal, center)
    return None if joints is None else replace(mirror, joints=joints)


def _stays(path: ObjectPath, normal: Array) -> bool:
    """Return whether the object moves and rotates only within a plane with that normal."""
    start = path.pose(0.0)[1] @ normal
    for tilt in np.linspace(0.0, path.end, _LOOKS):
        aside = path.pose(float(tilt))[1] @ normal - start
        if abs(aside) > _ALIKE or np.abs(np.cross(path.axis(float(tilt)), normal)).max() > _ALIKE:
            return False
    return True


def _images(
    scenario: Scenario, normal: Array, center: Array
) -> dict[str, tuple[str, float]] | None:
    """Return the images of the first chain's joints in the second chain, and their signs."""
    scene = compose(scenario).compile()
    data = mujoco.MjData(scene)
    data.qpos[:] = scene.qpos0
    mujoco.mj_kinematics(scene, data)
    first, second = chains(scene, scenario).values()
    if len(first) != len(second) or set(first) & set(second):
        return None
    found = {}
    for name, other in zip(first, second, strict=True):
        a, b = scene.joint(name).id, scene.joint(other).id
        axis, arm = data.xaxis[a], data.xanchor[a] - center
        axis, anchor = axis - _twice(axis, normal), center + (arm - _twice(arm, normal))
        sign = float(np.sign(axis @ data.xaxis[b]))
        apart = np.cross(anchor - data.xanchor[b], axis)
        if np.abs(axis - sign * data.xaxis[b]).max() > _ALIKE or np.abs(apart).max() > _ALIKE:
            return None
        # The image of a rotation about an axis is the opposite rotation about the axis' image.
        turns = scene.jnt_type[a] == mujoco.mjtJoint.mjJNT_HINGE
        found[name] = (other, -sign if turns else sign)
    return found


def _twice(v: Array, normal: Array) -> Array:
    """Return twice the part of a vector along the unit normal, which a reflection removes, (3,)."""
    return 2.0 * normal.dot(v) * normal
