"""Closed-loop trials of capacities."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fulcrum.sim.evaluation import Verdict
from fulcrum.sim.geometry import GRAVITY
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.sim.signals import Progress
from fulcrum.synthesis.render import Bullets, Page, page

# Largest number of failures on a page.
_TOLD = 3


@dataclass(frozen=True)
class Trial:
    """The result of a closed-loop run with a share of the capacity.

    Attributes:
        share: Share of the capacity [-].
        weight: Weight of the object [N].
        verdict: Verdict of the run.
        failures: Failures as sentences, in order of time.
        failed_syntheses: Number of syntheses without forces.
        syntheses: Number of all syntheses.
        torque_utilisation: Largest used share of a torque limit [-].
        joint: Joint with that share.
        saturated_fraction: Share of the time in which a torque was cut [-].
        tilt_error_deg: Largest tilt error [deg].
        slip_mm: Largest slip of all contacts [mm].
    """

    share: float
    weight: float
    verdict: Verdict
    failures: tuple[str, ...]
    failed_syntheses: int
    syntheses: int
    torque_utilisation: float
    joint: str
    saturated_fraction: float
    tilt_error_deg: float
    slip_mm: float

    def page(self) -> Page:
        """Return verdict, measurements and the first failures as a page."""
        return page(
            (
                f"{100 * self.share:.0f} % ({self.weight:.4g} N) in closed loop: ",
                self.verdict.shown,
                f"; {self.failed_syntheses} of {self.syntheses} syntheses without solution, torque "
                f"at most {100 * self.torque_utilisation:.1f} % ({self.joint}), cut "
                f"{100 * self.saturated_fraction:.1f} % of the time, tilt error "
                f"{self.tilt_error_deg:.3f} deg, slip {self.slip_mm:.3f} mm",
            ),
            Bullets(self.failures[:_TOLD]),
        )


def confirm(
    scenario: Scenario,
    controller: str,
    control: Control,
    capacity: float,
    share: float,
    progress: Progress | None = None,
) -> Trial:
    """Run the closed loop with a share of the capacity; the inertia is scaled with the mass.

    Args:
        scenario: Scene.
        controller: Name of the controller.
        control: Settings of the controller.
        capacity: Largest weight that can be held [N].
        share: Share of the capacity to run with [-].
        progress: Called with steps done and steps in total.

    Raises:
        PathError: The arms cannot follow the path.
    """
    thing, weight = scenario.object, share * capacity
    heavy = thing.weighing(weight / (thing.mass * GRAVITY))
    request = Request(replace(scenario, object=heavy), controller, control, best_effort=True)
    report = execute(request, progress).report
    return Trial(
        share=share,
        weight=weight,
        verdict=report.verdict,
        failures=report.sentences,
        failed_syntheses=report.synthesis.failures,
        syntheses=report.synthesis.solves,
        torque_utilisation=report.torque.max_utilisation,
        joint=report.torque.joint,
        saturated_fraction=report.torque.saturated_fraction,
        tilt_error_deg=report.tilt.max_error_deg,
        slip_mm=max(c.slip_mm for c in report.contacts.values()),
    )
