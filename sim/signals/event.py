"""What a run is doing, what was found wrong, and what was done about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import NamedTuple


class Mode(IntEnum):
    """What a run is doing; a trace holds the number."""

    RUN = 0
    HOLD = 1
    LOWER = 2
    STOP = 3


class Cause(StrEnum):
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


class Reaction(StrEnum):
    """What the guard did."""

    HOLD = "hold"
    RUN = "run"
    LOWER = "lower"
    STOP = "stop"
    END = "end"


class Finding(NamedTuple):
    """A cause that is there now, and in words what was found."""

    cause: Cause
    text: str


@dataclass(frozen=True)
class Event:
    """What was found, when, and what was done.

    Attributes:
        t: Time [s].
        cause: What was found; of ``run`` what has passed, of ``end`` why the object was lowered.
        reaction: What was done.
        text: What was found, in words.
    """

    t: float
    cause: Cause
    reaction: Reaction
    text: str
