"""Faults during a run: in sensors, transmission or motors, or on the object."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import not_negative


class FaultKind(StrEnum):
    """Kind of a fault. Each is injected where it would occur, never in the controller."""

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
        """Whether the fault is one of a single joint."""
        return self in _AT_JOINT


_AT_JOINT = (
    FaultKind.TORQUE_LOST,
    FaultKind.TORQUE_STUCK,
    FaultKind.ENCODER_FROZEN,
    FaultKind.ENCODER_DEAD,
)


@dataclass(frozen=True)
class Fault:
    """A fault of one component, with start and duration.

    A lost torque is 0; a stuck torque keeps its last value. A frozen sensor repeats its last value;
    a dead one gives NaN. During a silence nothing arrives at the drives.

    Attributes:
        kind: Kind of the fault.
        t: Start [s].
        duration_s: Duration [s]; to the end of the run by default.
        joint: Name of the joint, for faults of a joint; else empty.
        extra_n: Weight added at the object's centre of mass [N], for faults of the object; else 0.
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
        """Return whether the fault is present at time t [s]."""
        return self.t <= t < self.t + self.duration_s


def of_kinds(faults: Iterable[Fault], *kinds: FaultKind) -> tuple[Fault, ...]:
    """Return the faults of the given kinds."""
    return tuple(fault for fault in faults if fault.kind in kinds)
