"""Makes the scenario of a file's tables; raises FileError where they do not fit together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fulcrum.assets import ROBOTS
from fulcrum.scenarios.reading.access import Access
from fulcrum.scenarios.reading.contacts import make_hand, make_support
from fulcrum.scenarios.reading.object import Thing, make_object, make_surface, make_thing, material
from fulcrum.scenarios.reading.places import direction, only_one, orientation, vector
from fulcrum.scenarios.reading.source import KeyPath, Source
from fulcrum.scenarios.schema.motion import (
    ManoeuvreTable,
    PosesTable,
    RobotTable,
    ScrewTable,
    TiltTable,
)
from fulcrum.scenarios.schema.tables import ScenarioFile
from fulcrum.sim.geometry import Pose
from fulcrum.sim.scenario import (
    HOLD,
    LEAVE,
    REACH,
    SUPPORT,
    TILT,
    Phase,
    Pivot,
    Poses,
    Rest,
    Robot,
    Scenario,
    Support,
    stretched,
)


def build(source: Source, file: ScenarioFile, access: Access) -> Scenario:
    """Return the scenario of a file, named as the file is."""
    thing = make_thing(source, file.object, access)
    geoms = {n: make_surface(source, n, table) for n, table in file.environment.items()}
    _check_names(source, file, thing)
    supports = tuple(
        make_support(thing, n, table, file.environment, geoms) for n, table in file.supports.items()
    )
    with source.at(()):
        return Scenario(
            name=source.file.stem,
            summary=file.summary,
            object=make_object(thing, file.object),
            environment=tuple(geoms.values()),
            hands=tuple(make_hand(thing, n, hand, access) for n, hand in file.hands.items()),
            supports=supports,
            robots=tuple(_robot(source, i, r, access) for i, r in enumerate(file.robots)),
            path=_path(thing, file.path),
            rests=_rests(thing, file, supports),
            phases=_phases(source, file.manoeuvre),
            standoff=file.manoeuvre.standoff_m,
            holdable=file.holdable,
            control=file.control,
            physics=file.physics,
            tolerances=file.tolerances,
            view=file.view,
        )


def _check_names(source: Source, file: ScenarioFile, thing: Thing) -> None:
    """Refuse a name given twice, and robots with the same prefix."""
    for name in file.supports:
        if name in file.hands:
            raise source.error(("supports", name), name, "a name that no hand has")
    own = {thing.name, *(geom.name for geom in thing.shape.geoms(thing.name))}
    for name in file.environment:
        if name in own:
            raise source.error(("environment", name), name, "a name that the object does not use")
    prefixes = [robot.prefix for robot in file.robots]
    for index, prefix in enumerate(prefixes):
        if prefix in prefixes[:index]:
            valid = "a prefix that no other robot has"
            raise source.error(("robots", index, "prefix"), f'"{prefix}"', valid)


def _rests(thing: Thing, file: ScenarioFile, supports: tuple[Support, ...]) -> tuple[Rest, ...]:
    """Return the surfaces with friction that have no support."""
    taken = {support.surface for support in supports}
    return tuple(
        Rest(
            thing.resting,
            name,
            surface.friction,
            material(thing.source, ("environment", name, "contact"), surface.contact, SUPPORT),
        )
        for name, surface in file.environment.items()
        if surface.friction is not None and name not in taken
    )


def _robot(source: Source, index: int, table: RobotTable, access: Access) -> Robot:
    key: KeyPath = ("robots", index)
    posture: dict[str, float] = {}
    for name, values, unit in (
        ("posture_deg", table.posture_deg, math.radians(1.0)),
        ("posture_rad", table.posture_rad, 1.0),
        ("posture_m", table.posture_m, 1.0),
    ):
        for joint, value in values.items():
            if joint in posture:
                raise source.error((*key, name, joint), value, "in only one posture table")
            posture[joint] = unit * value
    what = "a URDF or MJCF file"
    with source.at(key):
        return Robot(
            model=access.model((*key, "model"), table.model, tuple(ROBOTS), what),
            posture=posture,
            prefix=table.prefix,
            still=tuple(table.still),
            base=Pose(vector(table.position_m), orientation(source, key, table)),
            start_deviation=table.start_deviation,
            torque_limits={**table.torque_limit_nm, **table.force_limit_n},
            speed_limits={**table.speed_limit_rad_s, **table.speed_limit_m_s},
        )


def _path(thing: Thing, table: TiltTable | ScrewTable | PosesTable) -> Pivot | Poses:
    if isinstance(table, PosesTable):
        return _poses(thing, table)
    key: KeyPath = ("path",)
    source = thing.source
    only_one(source, key, {"edge": table.edge, "point_m": table.point_m})
    if table.edge is not None:
        given: object = table.edge
        if table.axis is not None:
            raise source.error((*key, "axis"), table.axis, "left out where there is an edge")
        corners = [thing.corner((*key, "edge"), name) for name in table.edge]
        first, second = (thing.start.in_parent(end) for end in corners)
        point, axis = (first + second) / 2.0, second - first
    else:
        given = table.axis
        if table.axis is None:
            valid = "a direction, such as [0, -1, 0]"
            raise source.error((*key, "axis"), "nothing", valid)
        assert table.point_m is not None
        point, axis = np.asarray(table.point_m), np.asarray(table.axis)
    length = float(np.linalg.norm(axis))
    if not 1e-6 < length < 1e6:
        name = "axis" if table.edge is None else "edge"
        valid = "two different corners" if table.edge else "a direction, such as [0, -1, 0]"
        raise source.error((*key, name), given, valid)
    pitch, travel = 0.0, [0.0, 0.0, 0.0]
    if isinstance(table, ScrewTable):
        pitch, travel = table.pitch_m_per_rad, table.travel_m
    return Pivot(
        start=thing.start,
        point_W=vector(point),
        axis_W=direction(axis / length),
        angle_deg=table.angle_deg,
        pitch=pitch,
        travel=vector(travel),
    )


def _poses(thing: Thing, table: PosesTable) -> Poses:
    key: KeyPath = ("path", "poses")
    passed = [
        Pose(vector(pose.position_m), orientation(thing.source, (*key, i), pose))
        for i, pose in enumerate(table.poses)
    ]
    with thing.source.at(("path",)):
        return Poses((thing.start, *passed))


def _phases(source: Source, table: ManoeuvreTable) -> tuple[Phase, ...]:
    if table.phases is None:
        after: tuple[Phase, ...] = HOLD
        if table.after == "leave":
            standoff = table.standoff_m
            after = tuple(replace(p, gap=standoff) if p.gap > 0.0 else p for p in LEAVE)
        lasts = (table.approach_s, table.touch_s, table.grip_s)
        reach = (replace(p, duration_s=d) for p, d in zip(REACH, lasts, strict=True))
        return stretched((*reach, *TILT, *after), table.tilt_s)
    for name in ("approach_s", "touch_s", "grip_s", "tilt_s", "after"):
        if name in table.model_fields_set:
            given = getattr(table, name)
            raise source.error(("manoeuvre", name), given, "left out where phases are given")
    return tuple(table.phases)
