"""Errors of a scenario file that only the composed scene shows."""

from __future__ import annotations

from pathlib import Path

from fulcrum.scenarios.reading.file import open_source
from fulcrum.scenarios.reading.source import FileError, KeyPath, Source, nearest
from fulcrum.sim.model import compose
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis import InvalidInputError

_ONE_OF = "one of "


def check_scene(file: Path, scenario: Scenario) -> None:
    """Compose the scene, which shows which joints and bodies the robots have.

    Raises:
        FileError: The file names what they do not have, or gives angles out of range.
    """
    source = open_source(file)
    try:
        compose(scenario)
    except FileError:
        raise
    except InvalidInputError as error:
        given, valid = str(error.given), error.valid
        key = _scene_key(source, scenario, error.field, given)
        if valid.startswith(_ONE_OF):
            valid = nearest(given, valid.removeprefix(_ONE_OF).split(", "))
        raise source.error(key, given, valid) from None


def _scene_key(source: Source, scenario: Scenario, field: str, given: str) -> KeyPath:
    """Return the key that a field of the scenario comes from, as far as it is known."""
    if "lifted_from" in source.data:
        return ("lifted_from",)
    head, *rest = field.split(".")
    for table, contacts in (("hands", scenario.hands), ("supports", scenario.supports)):
        if head in [contact.name for contact in contacts]:
            here = source.data[table][head]
            names = [name for name in _CONTACT_KEYS.get(rest[0], ()) if name in here]
            return (table, head, *names[:1])
    if head in ("path", "object"):
        return (head, *[name for name in rest[:1] if name in source.data[head]])
    for index, robot in enumerate(scenario.robots):
        if head == robot.label:
            return _robot_key(source, index, [*rest, given][:2])
    if head in source.data.get("environment", {}):
        return ("environment", head)
    return ()


# Keys of a hand's or a support's table that hold what a field of the dataclass does.
_CONTACT_KEYS = {
    "mount": ("mount",),
    "model": ("tip",),
    "p_OC_O": ("point_m", "face"),
    "p_OP_O": ("point_m", "corner"),
}
# Keys of a robot's table that hold what a field of the dataclass does.
_ROBOT_KEYS = {
    "posture": ("posture_deg", "posture_rad", "posture_m"),
    "torque_limits": ("torque_limit_nm", "force_limit_n"),
    "speed_limits": ("speed_limit_rad_s", "speed_limit_m_s"),
}


def _robot_key(source: Source, index: int, rest: list[str]) -> KeyPath:
    """Return the key of a robot's field, and of a joint in it, if there is one."""
    table, key = source.data["robots"][index], ("robots", index)
    field, joint = rest
    names = [n for n in _ROBOT_KEYS.get(field, (field,)) if n in table]
    for name in names:
        if isinstance(table[name], dict) and joint in table[name]:
            return (*key, name, joint)
    return (*key, names[0]) if names else key
