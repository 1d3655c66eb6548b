"""Writes a placement into a scenario file: only what moved changes, and comments stay."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import tomlkit

from fulcrum.scenarios.reading.file import SCHEMA
from fulcrum.sim.geometry import Shape
from fulcrum.sim.placement import coordinates
from fulcrum.sim.scenario import Hand, Robot, Scenario

_POSTURES = {"posture_deg": (math.degrees, 4), "posture_rad": (float, 6), "posture_m": (float, 6)}
_SCHEMA = "#:schema "
# Digits: micrometres, a millionth of a degree or of a face, and directions.
_DIGITS, _DIRECTION_DIGITS = 6, 9


def placed(text: str, before: Scenario, after: Scenario, note: str, elsewhere: bool) -> str:
    """Return the text of a scenario file after a placement.

    Args:
        text: Text of the file.
        before: Scenario of the file.
        after: The same scenario after the placement.
        note: Comment for the head of the file.
        elsewhere: Whether the file goes to another folder, with the schema beside it.
    """
    document = tomlkit.parse(text)
    for table, old, new in zip(document["robots"], before.robots, after.robots, strict=True):
        _stand(table, old, new)
    shape = after.object.shape
    assert shape is not None
    for old_hand, new_hand in zip(before.hands, after.hands, strict=True):
        if new_hand != old_hand:
            _hold(document["hands"][new_hand.name], shape, old_hand, new_hand)
    head, _, rest = tomlkit.dumps(document).partition("\n")
    if not head.startswith(_SCHEMA):
        return f"# {note}\n{head}\n{rest}"
    if elsewhere:
        head = f"{_SCHEMA}{SCHEMA.name}"
    return f"{head}\n# {note}\n{rest}"


def _stand(table: Any, old: Robot, new: Robot) -> None:
    """Write where a robot stands, and its start posture."""
    if new.base.position != old.base.position:
        table["position_m"] = _numbers(new.base.position)
    if new.base.quaternion != old.base.quaternion:
        if "quaternion" in table:
            table["quaternion"] = _numbers(new.base.quaternion, _DIRECTION_DIGITS)
        else:
            table["rpy_deg"] = _numbers(new.base.rotation.as_euler("xyz", degrees=True))
    for joint, angle in new.posture.items():
        if angle == old.posture[joint]:
            continue
        for name, (unit, digits) in _POSTURES.items():
            if joint in table.get(name, {}):
                table[name][joint] = round(unit(angle), digits)


def _hold(table: Any, shape: Shape, old: Hand, new: Hand) -> None:
    """Write where and how a hand holds the object."""
    if new.p_OC_O != old.p_OC_O:
        if "face" in table:
            face = shape.closest(new.p_OC_O).face
            table["face"] = face
            table["at"] = _numbers(coordinates(shape, face, new.p_OC_O))
        else:
            table["point_m"] = _numbers(new.p_OC_O)
    if "normal" in table and new.normal_O != old.normal_O:
        table["normal"] = _numbers(new.normal_O, _DIRECTION_DIGITS)
    # What a file leaves out depends on the normal.
    if (new.tangent_O, new.normal_O) != (old.tangent_O, old.normal_O):
        table["tangent"] = _numbers(new.tangent_O, _DIRECTION_DIGITS)


def _numbers(values: Any, digits: int = _DIGITS) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]


def beside(file: Path) -> Path:
    """Return the default name of the placed file of a file."""
    return file.with_stem(f"{file.stem}-placed")
