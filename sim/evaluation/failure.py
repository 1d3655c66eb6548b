"""Failures of a run: time, category, subject and text."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Category(StrEnum):
    """The kind of a failure."""

    LOST = "lost"
    SLIP = "slip"
    SLIDE = "slide"
    SPIN = "spin"
    FRICTION = "friction"
    FORCE = "force"
    IMPACT = "impact"
    TOUCH = "touch"
    COLLISION = "collision"
    TRACKING = "tracking"
    SATURATED = "saturated"
    NO_FORCES = "no-forces"
    GIVEN_UP = "given-up"
    ERROR = "error"
    TILT = "tilt"
    PLACE = "place"
    DROPPED = "dropped"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Failure:
    """A tolerance that was not kept.

    Attributes:
        t: Time at which it began [s].
        category: Kind of failure.
        subject: Contact, joint or pair of geoms; empty for the run as a whole.
        text: The failure as a sentence.
    """

    t: float
    category: Category
    subject: str
    text: str

    @property
    def cause(self) -> str:
        """Category and subject, by which failures are counted: ``slip left``."""
        return f"{self.category} {self.subject}".strip()
