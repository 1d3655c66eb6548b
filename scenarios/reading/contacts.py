"""Makes hands and supports of a file's tables; raises FileError where they are off the surface."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fulcrum.assets import HANDS
from fulcrum.scenarios.reading.access import Access
from fulcrum.scenarios.reading.object import Thing, front, material
from fulcrum.scenarios.reading.places import (
    ON_SURFACE,
    direction,
    only_one,
    surface_normal,
    turn,
    usual_tangent,
    vector,
)
from fulcrum.scenarios.reading.source import KeyPath, Source, nearest
from fulcrum.scenarios.schema.tables import HandTable, SupportTable, SurfaceTable
from fulcrum.sim.geometry import Geom, Pose
from fulcrum.sim.model import across
from fulcrum.sim.scenario import PAD, SUPPORT, Hand, Support
from fulcrum.synthesis.arrays import Array, Vector

# How far a given tangent may be from perpendicular [-]: points are given to a micrometre, on which
# the normal of a curved face depends. Below the second number a tangent is taken as it is.
_ACROSS, _EXACT = 1e-3, 1e-12


def make_hand(thing: Thing, name: str, table: HandTable, access: Access) -> Hand:
    """Return a hand and where it holds the object."""
    key: KeyPath = ("hands", name)
    point, normal = _touched(thing, key, table)
    normal = _normal(thing.source, key, table.normal, normal)
    with thing.source.at(key):
        return Hand(
            name=name,
            mount=table.mount,
            model=access.model((*key, "tip"), table.tip, HANDS, "an MJCF file"),
            geom=thing.shape.touched(thing.name, point),
            p_OC_O=point,
            normal_O=normal,
            tangent_O=_tangent(thing.source, key, table.tangent, normal),
            friction=table.friction,
            f_n_max=math.inf if table.grip_limit_n is None else table.grip_limit_n,
            mount_pose=Pose(vector(table.mount_position_m or [0.0] * 3), turn(table.mount_rpy_deg)),
            material=material(thing.source, (*key, "contact"), table.contact, PAD),
        )


def _touched(thing: Thing, key: KeyPath, table: HandTable) -> tuple[Vector, Vector]:
    """Return where a hand touches the object, and the inward normal there."""
    source, shape = thing.source, thing.shape
    only_one(source, key, {"face": table.face, "point_m": table.point_m})
    named = [("may_touch", face) for face in table.may_touch or []]
    named += [] if table.face is None else [("face", table.face)]
    for name, face in named:
        if face not in shape.faces:
            raise source.error((*key, name), f'"{face}"', nearest(face, list(shape.faces)))
    if table.face is not None:
        with source.at((*key, "face")):
            place = shape.place(table.face, *(table.at or (0.5, 0.5)))
        return place.point, direction(place.normal)
    assert table.point_m is not None
    if table.at is not None:
        raise source.error((*key, "at"), table.at, "left out where there is a point_m")
    point = vector(table.point_m)
    place = shape.closest(point)
    _check_near(source, (*key, "point_m"), point, place.point, "the object's surface")
    return point, direction(place.normal)


def make_support(
    thing: Thing,
    name: str,
    table: SupportTable,
    surfaces: dict[str, SurfaceTable],
    geoms: dict[str, Geom],
) -> Support:
    """Return a point of the object that stays on a surface."""
    key: KeyPath = ("supports", name)
    source, surface = thing.source, surfaces.get(table.surface)
    if surface is None:
        known = nearest(table.surface, list(surfaces))
        raise source.error((*key, "surface"), f'"{table.surface}"', known)
    where: KeyPath = ("environment", table.surface)
    if surface.friction is None:
        valid = f"friction, such as {{ mu = 0.3 }}, for {name}"
        raise source.error((*where, "friction"), "nothing", valid)
    point = _support_point(thing, key, table)
    p_W = thing.start.in_parent(point)
    closest, outward = surface_normal(geoms[table.surface], front(surface), p_W)
    which = (*key, "corner" if table.corner is not None else "point_m")
    moved = f", or object.position_m = {_shown(thing.start.position + closest - p_W)}"
    _check_near(source, which, point, thing.start.in_frame(closest), table.surface, moved)
    normal = _normal(source, key, table.normal, direction(outward))
    return Support(
        name=name,
        geom=thing.resting,
        surface=table.surface,
        p_OP_O=point,
        normal_W=normal,
        tangent_W=_tangent(source, key, table.tangent, normal),
        friction=surface.friction,
        material=material(source, (*where, "contact"), surface.contact, SUPPORT),
    )


def _support_point(thing: Thing, key: KeyPath, table: SupportTable) -> Vector:
    only_one(thing.source, key, {"corner": table.corner, "point_m": table.point_m})
    if table.corner is not None:
        return thing.corner((*key, "corner"), table.corner)
    assert table.point_m is not None
    point = vector(table.point_m)
    closest = thing.shape.closest(point).point
    _check_near(thing.source, (*key, "point_m"), point, closest, "the object's surface")
    return point


def _check_near(
    source: Source,
    key: KeyPath,
    p: Vector,
    closest: Sequence[float] | Array,
    what: str,
    remedy: str = "",
) -> None:
    off = math.dist(p, closest)
    if not off <= ON_SURFACE:
        given = f"{_shown(p)}, {1e3 * off:.1f} mm off {what}"
        valid = f"a point on it, the nearest being {_shown(closest)}{remedy}"
        raise source.error(key, given, valid)


def _normal(source: Source, key: KeyPath, given: list[float] | None, own: Vector) -> Vector:
    """Return the given normal, which must point to the same side as the surface's own."""
    if given is None:
        return own
    normal = _direction(source, (*key, "normal"), given)
    if not np.dot(normal, own) > 0.0:
        valid = f"a direction into the object, such as {_shown(own)}"
        raise source.error((*key, "normal"), given, valid)
    return normal


def _tangent(source: Source, key: KeyPath, given: list[float] | None, normal: Vector) -> Vector:
    if given is None:
        return usual_tangent(normal)
    tangent = _direction(source, (*key, "tangent"), given)
    along = abs(np.dot(tangent, normal))
    if not along < _ACROSS:
        valid = f"a direction perpendicular to the normal {_shown(normal)}"
        raise source.error((*key, "tangent"), given, valid)
    if along < _EXACT:
        return tangent
    return direction(across(np.asarray(tangent), np.asarray(normal)))


def _direction(source: Source, key: KeyPath, values: list[float]) -> Vector:
    """Return a direction of length 1."""
    length = math.hypot(*values)
    if not 1e-6 < length < 1e6:
        raise source.error(key, values, "a direction, such as [0, 0, 1]")
    return direction(values if length == 1.0 else np.asarray(values) / length)


def _shown(values: Sequence[float] | Array) -> str:
    return f"[{', '.join(f'{float(value):.4g}' for value in values)}]"
