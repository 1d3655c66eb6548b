"""What may break during a run: in the sensors, on the wire, in the motors, or on the object."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import not_negative


class FaultKind(StrEnum):
    """What breaks; each is injected where it would arise, never in the controller."""

    TORQUE_LOST = "torque lost"
    TORQUE_STUCK = "torque stuck"
    ENCODER_FROZEN = "encoder frozen"
    ENCODER_DEAD = "encoder dead"
    POSE_FROZEN = "pose frozen"
    POSE_DEAD = "pose dead"
    SILENCE = "silence"
    WEIGHT = "weight"

    @property
    def at_joint(self) -> bool:
        """Whether it befalls one joint."""
        return self in _AT_JOINT


_AT_JOINT = (
    FaultKind.TORQUE_LOST,
    FaultKind.TORQUE_STUCK,
    FaultKind.ENCODER_FROZEN,
    FaultKind.ENCODER_DEAD,
)


@dataclass(frozen=True)
class Fault:
    """One thing that breaks, and for how long.

    A lost torque is 0 and a stuck one stays what it was; a frozen sensor repeats its last value and
    a dead one gives NaN; in a silence nothing arrives at the drives until it is over.

    Attributes:
        kind: What breaks.
        t: When it begins [s].
        duration_s: How long it lasts [s]; for good by default.
        joint: The joint that it befalls, where it is a joint's; else empty.
        extra_n: Weight added at the object's centre of mass [N], where it is the object's; else 0.
    """

    kind: FaultKind
    t: float
    duration_s: float = math.inf
    joint: str = ""
    extra_n: float = 0.0

    def __post_init__(self) -> None:
        not_negative("fault.t", self.t)
        if not self.duration_s > 0.0:
            raise InvalidInputError("fault.duration_s", self.duration_s, "a number > 0")
        if not isinstance(self.kind, FaultKind):
            raise InvalidInputError("fault.kind", self.kind, f"one of {', '.join(FaultKind)}")
        if self.kind.at_joint != bool(self.joint):
            valid = "the name of a joint" if self.kind.at_joint else f"none for {self.kind}"
            raise InvalidInputError("fault.joint", repr(self.joint), valid)
        not_negative("fault.extra_n", self.extra_n)
        if (self.kind is FaultKind.WEIGHT) != (self.extra_n > 0.0):
            valid = "a number > 0 for weight, 0 for all else"
            raise InvalidInputError("fault.extra_n", self.extra_n, valid)

    def active(self, t: float) -> bool:
        """Whether it is there at a time [s]."""
        return self.t <= t < self.t + self.duration_s


def of_kinds(faults: Iterable[Fault], *kinds: FaultKind) -> tuple[Fault, ...]:
    """The faults of some kinds."""
    return tuple(fault for fault in faults if fault.kind in kinds)
