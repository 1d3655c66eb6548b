"""When an episode is a success, and what its failure began with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.run.execute import Result
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.trace import Trace, stretches
from fulcrum.synthesis.arrays import Mask
from fulcrum.synthesis.checks import each, positive


@dataclass(frozen=True)
class Criteria:
    """What an episode must keep to; wider than a scenario's tolerances, for worlds as they are.

    Attributes:
        final_deg: Deviation of the final tilt from its target [deg].
        hand_slip_mm: Slip of each hand while it holds with full grip [mm].
        support_slip_mm: The same of each support, whether or not it keeps in touch [mm].
        saturated_s: Time at a stretch in which a joint's torque is cut [s].
    """

    final_deg: float = 2.0
    hand_slip_mm: float = 5.0
    support_slip_mm: float = 3.0
    saturated_s: float = 0.05

    def __post_init__(self) -> None:
        each("criteria", self, positive)


@dataclass(frozen=True)
class Violation:
    """A criterion that was not kept.

    Attributes:
        t: When first [s].
        category: error, lost, saturated, slip or tilt.
        where: Contact or joint; empty for the whole.
    """

    t: float
    category: str
    where: str = ""

    @property
    def text(self) -> str:
        """What happened, and to which contact or joint."""
        return f"{self.category} {self.where}".strip()


def violations(
    criteria: Criteria, scenario: Scenario, joints: tuple[str, ...], result: Result
) -> tuple[Violation, ...]:
    """All criteria that a run did not keep, in order of time: the first is the cause.

    Args:
        criteria: What it must keep to.
        scenario: What the controller believes.
        joints: Names of the robot's joints.
        result: The run.
    """
    trace, history, hands = result.trace, result.history, len(scenario.hands)
    held = Schedule(scenario).held[trace.phase.astype(int)]
    found = []
    for i, name in enumerate(scenario.contact_names):
        limit = criteria.hand_slip_mm if i < hands else criteria.support_slip_mm
        # Not "more than": what is no number is no success.
        slipped = held & ~(1e3 * history.slip[:, i] <= limit)
        if i < hands:
            lost = held & ~history.kept[:, i]
            found += _first(trace, lost, "lost", name)
            slipped &= ~np.logical_or.accumulate(lost)
        found += _first(trace, slipped, "slip", name)
    most = round(criteria.saturated_s / scenario.physics.timestep)
    for i, name in enumerate(joints):
        found += _first(trace, stretches(trace.saturated[:, i]) > most, "saturated", name)
    end = float(trace.t[-1])
    tilt = result.report.tilt
    if not abs(tilt.final_deg - tilt.target_deg) <= criteria.final_deg:
        found.append(Violation(end, "tilt"))
    if result.error is not None:
        found.append(Violation(end, "error"))
    return tuple(sorted(found, key=lambda violation: (violation.t, violation.text)))


def _first(trace: Trace, mask: Mask, category: str, where: str) -> list[Violation]:
    if not mask.any():
        return []
    return [Violation(float(trace.t[int(np.argmax(mask))]), category, where)]
