"""What a run did not keep to: when, in which respect, where, and in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Category(StrEnum):
    """In which respect a run failed."""

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
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Failure:
    """A tolerance that was not kept.

    Attributes:
        t: When first [s].
        category: In which respect.
        subject: Contact, joint or pair of geoms; empty for the run as a whole.
        text: The failure as a sentence.
    """

    t: float
    category: Category
    subject: str
    text: str

    @property
    def cause(self) -> str:
        """Category and subject, for counting: ``slip left``."""
        return f"{self.category} {self.subject}".strip()
