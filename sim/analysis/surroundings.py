"""Checks of the object's path against the surfaces around it: overlap, supports, toppling."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import Geom, read_mesh
from fulcrum.sim.model import ObjectMotion, ObjectPath, compose, distance, object_pairs
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import Array

# Tolerance of all places [m]; also the allowed distance of a contact from its surface.
_NEAR = 1e-3
# Steps of the tilt [deg]: a corner 0.5 m from the axis moves by less than 5 mm.
_STEP_DEG = 0.5
# Number of tangent planes that replace a round wall: error 0.05 mm at a radius of 0.18 m.
_ROUND = 128
# Number of rings of tangent planes that replace a rounded end.
_RINGS = 33
# Least z component of the normal of a level plane [-].
_LEVEL = 0.999


@dataclass(frozen=True)
class Misfit:
    """A misfit between the object's path and a surface.

    Attributes:
        tilt_deg: Tilt at which it is worst, or at which the object is let go [deg].
        off_m: Size of the misfit [m]; infinite if nothing is under the object.
        text: What is wrong and what helps, in one sentence.
    """

    tilt_deg: float
    off_m: float
    text: str


@dataclass(frozen=True)
class Surroundings:
    """The misfits between the object's path and the surfaces around it; None where there is none.

    Attributes:
        supports: Support that is off its surface, or moves.
        room: Surface that the object goes through.
        stand: Tilt at which the object topples with no hand on it.
    """

    supports: Misfit | None
    room: Misfit | None
    stand: Misfit | None

    @property
    def misfits(self) -> tuple[Misfit, ...]:
        """All misfits."""
        every = (self.supports, self.room, self.stand)
        return tuple(misfit for misfit in every if misfit is not None)


def surroundings(scenario: Scenario) -> Surroundings:
    """Check the object's path against the surfaces around it, without the robots.

    Raises:
        InvalidInputError: The scene cannot be composed.
    """
    path = object_path(scenario.path)
    steps = math.ceil(math.degrees(path.end) / _STEP_DEG)
    tilts = np.linspace(0.0, path.end, steps + 1)
    return Surroundings(
        _supports(scenario, path, tilts), _room(scenario, path, tilts), _stand(scenario, path)
    )


def _supports(scenario: Scenario, path: ObjectPath, tilts: Array) -> Misfit | None:
    """Return the first support that starts off its surface, else the one that moves most."""
    surfaces = {geom.name: geom for geom in scenario.environment}
    poses = [path.pose(tilt) for tilt in tilts.tolist()]
    moving: list[Misfit] = []
    for support in scenario.supports:
        places = np.array([p_WO + R_WO @ support.p_OP_O for R_WO, p_WO in poses])
        planes = _planes(surfaces[support.surface])
        off = float((planes[:, :3] @ places[0] + planes[:, 3]).max())
        if abs(off) > _NEAR:
            side = "outside" if off > 0.0 else "inside"
            text = (
                f"{support.name} is {_mm(off)} {side} {support.surface} at a tilt of 0 deg; "
                "move the object or the surface until they touch there."
            )
            return Misfit(0.0, abs(off), text)
        moved = np.linalg.norm(places - places[0], axis=1)
        worst = int(moved.argmax())
        if moved[worst] > _NEAR:
            tilt = math.degrees(tilts[worst])
            text = (
                f"{support.name} moves by {_mm(moved[worst])} up to a tilt of {tilt:.1f} deg, but "
                "supports are to stay in place; let the path's edge or axis go through all of them."
            )
            moving.append(Misfit(tilt, float(moved[worst]), text))
    return max(moving, key=lambda misfit: misfit.off_m, default=None)


def _room(scenario: Scenario, path: ObjectPath, tilts: Array) -> Misfit | None:
    """Return the surface into which the object goes farthest."""
    model = compose(scenario, ObjectMotion.POSED).compile()
    data, thing = mujoco.MjData(model), model.body(scenario.object.name).mocapid[0]
    pairs = [(model.geom(g).id, model.geom(s).id) for g, s in _meeting(scenario)]
    if not pairs:
        return None
    depths = np.empty((len(tilts), len(pairs)))
    for k, tilt in enumerate(tilts.tolist()):
        R_WO, data.mocap_pos[thing] = path.pose(tilt)
        data.mocap_quat[thing] = Rotation.from_matrix(R_WO).as_quat(scalar_first=True)
        mujoco.mj_kinematics(model, data)
        depths[k] = [-distance(model, data, *pair) for pair in pairs]
    worst, pair = np.unravel_index(depths.argmax(), depths.shape)
    depth, tilt = float(depths[worst, pair]), math.degrees(tilts[worst])
    if not depth > _NEAR:
        return None
    surface = model.geom(pairs[pair][1]).name
    entered = math.degrees(tilts[int((depths[:, pair] > _NEAR).argmax())])
    helps = f"move {surface} out of its way"
    if entered > 1.0:
        helps += f", or end before it, with an angle_deg of {math.ceil(entered) - 1:d} at most"
    where = f"{_mm(depth)} into {surface} at a tilt of {tilt:.1f} deg"
    return Misfit(tilt, depth, f"{scenario.object.name} goes {where}; {helps}.")


def _meeting(scenario: Scenario) -> list[tuple[str, str]]:
    """Return pairs of a geom of the object and a surface, to be checked for overlap."""
    return [*_resting(scenario), *object_pairs(scenario)]


def _resting(scenario: Scenario) -> list[tuple[str, str]]:
    """Return pairs of a geom of the object and a surface on which it may lie."""
    pairs = [(s.geom, s.surface) for s in scenario.supports]
    return list(dict.fromkeys([*pairs, *((r.geom, r.surface) for r in scenario.rests)]))


def _stand(scenario: Scenario, path: ObjectPath) -> Misfit | None:
    """Return the first tilt at which no hand holds the object and it does not stand."""
    own = {geom.name: _planes(geom) for geom in scenario.object.geoms}
    others = {geom.name: _planes(geom) for geom in scenario.environment}
    shares = [0.0, *(phase.tilt for phase in scenario.phases if phase.grip == 0.0)]
    for share in dict.fromkeys(shares):
        R_WO, p_WO = path.pose(share * path.end)
        center = p_WO + R_WO @ np.asarray(scenario.object.center_of_mass)
        pairs = [(_moved(own[g], R_WO, p_WO), others[s]) for g, s in _resting(scenario)]
        beside = _beside([np.vstack(pair) for pair in pairs], center)
        if math.hypot(*beside) > _NEAR:
            endless = [np.vstack([thing, _tops(surface)]) for thing, surface in pairs]
            flat = math.hypot(*_beside(endless, center)) <= _NEAR
            return _toppling(scenario, share, beside, flat)
    return None


def _tops(planes: Array) -> Array:
    """Return the level top of the planes around a surface, (h, 4), or all if there is none."""
    tops = planes[planes[:, 2] > _LEVEL]
    return tops if len(tops) else planes


def _toppling(scenario: Scenario, share: float, beside: Array, flat: bool) -> Misfit:
    """Return the misfit of an object that is not held and does not stand.

    Args:
        scenario: Scene.
        share: Tilt, as a share of the path's angle [-].
        beside: Horizontal vector from the area on which it stands to its centre of mass [m], (2,).
        flat: Whether it would stand if the surfaces under it were large enough.
    """
    off, tilt = math.hypot(*beside), share * scenario.path.angle_deg
    surfaces = " and ".join(dict.fromkeys(surface for _, surface in _resting(scenario)))
    when = f"is let go at a tilt of {tilt:g} deg" if tilt else "is not held yet, at a tilt of 0 deg"
    where = "nothing that has friction is under it"
    if math.isfinite(off):
        axis = int(np.abs(beside).argmax())
        where = f"its centre of mass is {_mm(off)} beside what it stands on, towards "
        where += f"{'-' if beside[axis] < 0.0 else '+'}{'xy'[axis]}"
    helps = "let it lie flat there" if surfaces else "give the surface under it friction"
    if flat:
        helps = f"let {surfaces} reach as far as it stands"
    if tilt:
        helps += ', or hold it there with after = "hold"'
    return Misfit(tilt, off, f"{scenario.object.name} topples where it {when}: {where}; {helps}.")


def _beside(regions: list[Array], center: Array) -> Array:
    r"""Return the horizontal vector from an object's support area to its centre of mass [m], (2,).

    An object stands if its centre of mass is above the convex hull of all places where it touches;
    it is assumed not to slide on a wall on which it leans. With :math:`A_s x \le b_s` where it
    touches surface s, the nearest point of the projected hull is found by

    .. math::
        \min_{y, \lambda, e} \|e\| \quad \text{s.t.} \quad A_s y_s \le \lambda_s b_s, \quad
        \lambda \ge 0, \quad \sum_s \lambda_s = 1, \quad \sum_s (y_s)_{xy} + e = c_{xy}

    Source: Balas 1998, Disjunctive Programming: the convex hull of a union of polytopes.

    Args:
        regions: Planes around the common region of object and surface, (h, 4) for each surface:
            outward normals and offsets, n x + d <= 0 inside.
        center: Centre of mass [m], (3,).

    Returns:
        Vector, zero if the object stands; infinite if it touches nothing.
    """
    if not regions:
        return np.full(2, np.inf)
    count = 4 * len(regions)
    rows = np.zeros((sum(map(len, regions)) + _ROUND, count + 3))
    row = 0
    for s, region in enumerate(regions):
        rows[row : row + len(region), 4 * s : 4 * s + 4] = region
        # Planes are moved outwards by half the tolerance, so that touching faces overlap.
        rows[row : row + len(region), 4 * s + 3] -= _NEAR / 2.0
        row += len(region)
    rows[row:, count:-1], rows[row:, -1] = _ring(), -1.0  # length of e
    sums = np.zeros((3, count + 3))
    sums[0, 3:count:4] = 1.0
    for i in (0, 1):
        sums[1 + i, i:count:4] = sums[1 + i, count + i] = 1.0
    bounds: list[tuple[float | None, None]] = [(None, None)] * (count + 3)
    bounds[3:count:4] = [(0.0, None)] * len(regions)
    cost = np.zeros(count + 3)
    cost[-1] = 1.0
    found = linprog(cost, rows, np.zeros(len(rows)), sums, [1.0, *center[:2]], bounds)
    return found.x[count:-1] if found.success else np.full(2, np.inf)


def _moved(planes: Array, R: Array, p: Array) -> Array:
    """Return planes, (h, 4), in the parent's frame, in which their own frame has the pose R, p."""
    normals = planes[:, :3] @ R.T
    return np.column_stack([normals, planes[:, 3] - normals @ p])


def _planes(geom: Geom) -> Array:
    """Return planes of a geom's convex hull in its owner's frame, n x + d <= 0 inside, (h, 4)."""
    size, upright = np.asarray(geom.size), np.eye(3)[2:]
    if geom.file is not None:
        hull = read_mesh(f"{geom.name}.file", geom.file, geom.size).hull
        normals, reach = hull[:, :3], hull[:, 3]
    elif geom.kind == "plane":  # infinite in MuJoCo
        normals, reach = upright, np.zeros(1)
    elif geom.kind == "box":
        normals = np.vstack([np.eye(3), -np.eye(3)])
        reach = np.abs(normals) @ size
    elif geom.kind == "cylinder":
        around = np.column_stack([_ring(), np.zeros(_ROUND)])
        normals = np.vstack([around, upright, -upright])
        reach = np.repeat(size, (_ROUND, 2))
    else:
        heights = np.sin(np.linspace(-np.pi / 2.0, np.pi / 2.0, _RINGS))
        normals = np.vstack(
            [
                np.column_stack([math.sqrt(1.0 - z * z) * _ring(), np.full(_ROUND, z)])
                for z in heights
            ]
        )
        if geom.kind == "ellipsoid":
            reach = np.linalg.norm(normals * size, axis=1)
        else:  # a sphere, or a capsule about a line
            reach = size[0] + np.abs(normals[:, 2]) * size[1:].sum()
    R = geom.pose.rotation.as_matrix()
    return _moved(np.column_stack([normals, -reach]), R, np.asarray(geom.pose.position))


def _ring() -> Array:
    """Return unit vectors at equal angles around a circle, (_ROUND, 2)."""
    angles = 2.0 * np.pi / _ROUND * np.arange(_ROUND)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _mm(length: float) -> str:
    return f"{1e3 * abs(length):.1f} mm"
