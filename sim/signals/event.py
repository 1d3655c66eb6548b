"""What a run is doing, what was found wrong, and what was done about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import NamedTuple


class Mode(IntEnum):
    """What a run is doing; a trace holds the number."""

    RUN = 0
    HOLD = 1
    LOWER = 2
    STOP = 3


class Cause(Enum):
    """Why a run does not go on."""

    ENCODER = "encoder"
    MOTOR = "motor"
    OBJECT = "object"
    POSE = "pose"
    FORCES = "forces"
    SILENCE = "silence"
    SATURATION = "saturation"
    JOINT = "joint"
    TILT = "tilt"


class Finding(NamedTuple):
    """A cause that is there now, and in words what was found."""

    cause: Cause
    text: str


@dataclass(frozen=True)
class Event:
    """What was found, when, and what was done.

    Attributes:
        t: Time [s].
        cause: What was found, in words.
        reaction: hold, run, lower, stop or end.
    """

    t: float
    cause: str
    reaction: str
