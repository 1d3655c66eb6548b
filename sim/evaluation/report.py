"""The report of a run: verdict, outcome, failures and measurements."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from fulcrum.sim.evaluation.failure import Failure
from fulcrum.sim.evaluation.outcome import Outcome
from fulcrum.sim.signals import Event
from fulcrum.synthesis.render import (
    Bullets,
    Heading,
    Mark,
    Marked,
    Page,
    page,
    table,
    to_markdown,
)


class Verdict(StrEnum):
    """The judgement of a run."""

    PASS = "pass"
    FAIL = "fail"
    INTERRUPTED = "interrupted"

    @property
    def shown(self) -> Marked:
        """The verdict as shown on pages."""
        return Marked(self.upper(), _MARKS[self])


_MARKS = {
    Verdict.PASS: Mark.GOOD,
    Verdict.FAIL: Mark.BAD,
    Verdict.INTERRUPTED: Mark.DOUBTFUL,
}


@dataclass(frozen=True)
class PhaseReport:
    """One phase of the run: its name, start and end [s]."""

    name: str
    start_s: float
    end_s: float


@dataclass(frozen=True)
class TiltReport:
    """The tilt: target, final value and errors [deg], and the final position error [mm]."""

    target_deg: float
    final_deg: float
    final_mm: float
    rms_error_deg: float
    max_error_deg: float


@dataclass(frozen=True)
class ContactReport:
    """The measurements of one contact while the object was held with full grip.

    Slip, slide, spin and utilisation are measured until the contact is lost for the first time.
    ``free_normal_n`` is the largest normal force while no grip was commanded, as at an impact.
    ``longest_gap_ms`` is the longest time without a normal force.
    """

    kept_fraction: float
    slip_mm: float
    slide_mm: float
    spin_deg: float
    max_utilisation: float
    max_normal_n: float
    force_error_rms_n: float
    free_normal_n: float
    longest_gap_ms: float

    @property
    def kept_percent(self) -> float:
        """Share of the steps with contact [%], rounded down to 0.1, so that 100 means all."""
        return math.floor(1e3 * self.kept_fraction) / 10.0


@dataclass(frozen=True)
class TorqueReport:
    """The torques: largest used share of a limit, its joint, and share of steps with a cut [-]."""

    max_utilisation: float
    joint: str
    saturated_fraction: float


@dataclass(frozen=True)
class SynthesisReport:
    """The syntheses: number, failures, and wall time with assembly and unpacking [us]."""

    solves: int
    failures: int
    p50_us: float
    p99_us: float


@dataclass(frozen=True)
class TimingReport:
    """The time: simulated, wall time of loop, monitor and recording [s], and their ratio [-]."""

    sim_s: float
    wall_s: float
    real_time_factor: float


@dataclass(frozen=True)
class Report:
    """The result of a run, as in ``report.json``; all numbers are finite.

    ``disturbed`` says whether the tolerances for disturbed runs were used. ``failures`` are in
    order of time, so that the first is the cause. ``phases`` are in the order in which they were
    passed, backwards while lowering. ``events`` are the findings and reactions of the guard.
    """

    scenario: str
    controller: str
    objective: str
    seed: int
    disturbed: bool
    verdict: Verdict
    outcome: Outcome
    failures: tuple[Failure, ...]
    events: tuple[Event, ...]
    phases: tuple[PhaseReport, ...]
    tilt: TiltReport
    contacts: dict[str, ContactReport]
    torque: TorqueReport
    synthesis: SynthesisReport
    timing: TimingReport
    recording: str | None

    @property
    def sentences(self) -> tuple[str, ...]:
        """The failures as sentences."""
        return tuple(failure.text for failure in self.failures)

    def page(self) -> Page:
        """Return verdict, failures, events and contacts as a page."""
        tilt, torque, timing = self.tilt, self.torque, self.timing
        contacts = [
            (
                name,
                f"{c.kept_percent:.1f}",
                f"{c.longest_gap_ms:.0f}",
                f"{c.slip_mm:.3f}",
                f"{c.slide_mm:.3f}",
                f"{c.spin_deg:.3f}",
                f"{100.0 * c.max_utilisation:.0f}",
                f"{c.force_error_rms_n:.2f}",
            )
            for name, c in self.contacts.items()
        ]
        head = ("contact", "kept [%]", "gap [ms]", "slip [mm]", "slide [mm]", "spin [deg]")
        judged = ", judged as a disturbed run" if self.disturbed else ""
        return page(
            Heading((f"{self.scenario}: ", self.verdict.shown)),
            Bullets(self.sentences),
            table(
                ("time [s]", "event", "reaction"),
                [(f"{e.t:.3f}", e.text, e.reaction) for e in self.events],
            ),
            f"Outcome: {self.outcome}. Controller {self.controller}, objective {self.objective}, "
            f"seed {self.seed}{judged}.",
            table((*head, "friction used [%]", "force error [N]"), contacts),
            f"Tilt {tilt.final_deg:z.2f} of {tilt.target_deg:g} deg, error at most "
            f"{tilt.max_error_deg:.3f} deg; torque at most {100 * torque.max_utilisation:.0f} % of "
            f"its limit ({torque.joint}); {timing.real_time_factor:.1f} x real time.",
        )

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


@dataclass(frozen=True)
class RunInfo:
    """Facts about a run that its trace does not contain.

    Attributes:
        controller: Name of the controller.
        objective: Objective of the synthesis.
        seed: Seed of the run.
        wall_s: Wall time of loop, monitor and recording [s].
        interrupted: Whether the run was stopped before its end.
        error: Error that ended the run; None if there was none.
        recording: Name of the recording's file; None if there is none.
        collisions: Pairs of geoms that touched although they must not, with the first time [s].
        events: Findings and reactions of the guard.
    """

    controller: str
    objective: str
    seed: int
    wall_s: float
    interrupted: bool = False
    error: str | None = None
    recording: str | None = None
    collisions: Mapping[tuple[str, str], float] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
