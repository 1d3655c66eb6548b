"""Modes of a run, and events: causes of trouble and the guard's reactions."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import NamedTuple


class Mode(IntEnum):
    """Mode of a run; a trace holds the number."""

    RUN = 0
    HOLD = 1
    LOWER = 2
    STOP = 3


class Cause(StrEnum):
    """Cause for which the guard intervenes."""

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
    """Reaction of the guard."""

    HOLD = "hold"
    RUN = "run"
    LOWER = "lower"
    STOP = "stop"
    END = "end"


class Finding(NamedTuple):
    """A cause that is present now, and its description in words."""

    cause: Cause
    text: str


@dataclass(frozen=True)
class Event:
    """A reaction of the guard, with time and cause.

    Attributes:
        t: Time [s].
        cause: Cause found; for ``run`` the cause that has passed, for ``end`` that of the lowering.
        reaction: Reaction of the guard.
        text: Description of the cause in words.
    """

    t: float
    cause: Cause
    reaction: Reaction
    text: str
