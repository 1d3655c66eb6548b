"""The heaviest object that a scenario's robot can pivot, and lift, as optimisation over its weight.

At each tilt the largest weight that contacts and joints can hold is the optimum of one second-order
cone program; the least of these over the path is the capacity, and the certificate just above it
says what limits it. Runs in closed loop confirm it; they do not find it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from sim.conflict import Conflict, conflict
from sim.poses import PathProblems
from sim.report import Verdict
from sim.run import Progress, Request, execute
from sim.scenario import GRAVITY, Scenario, lifted
from sim.settings import Control
from synthesis import InfeasibleError, Synthesizer
from synthesis.relaxation import Kind, change, weight_range

_STEP_DEG = 1.0
# How well the tightest tilt is found [deg].
_TILT_DEG = 1e-3


@dataclass(frozen=True)
class Capacity:
    """The heaviest object in one manoeuvre, with the controller's margins.

    Attributes:
        manoeuvre: pivot or lift.
        weight: That can be held at every tilt of the path [N]; infinite if any can.
        mass: [kg].
        tilt_deg: Where it is limited [deg].
        lightest: The least weight that can be held at every tilt [N]; above 0 if preloads need it.
        conflict: What limits it there; None if nothing does.
        confirmed_within: How near to the weight solving again tells feasible from infeasible [-].
        tilts_deg: Grid of tilts [deg].
        weights: Largest weight at each [N]; 0 where none can be held.
    """

    manoeuvre: str
    weight: float
    mass: float
    tilt_deg: float
    lightest: float
    conflict: Conflict | None
    confirmed_within: float
    tilts_deg: tuple[float, ...]
    weights: tuple[float, ...]


@dataclass(frozen=True)
class Trial:
    """A closed-loop run with a share of the capacity.

    Attributes:
        share: Of the capacity [-].
        weight: [N].
        verdict: Of the run.
        failures: What went wrong, in order of time.
        failed_syntheses: How many found no forces, of ``syntheses``.
        syntheses: How many there were.
        torque_utilisation: Largest [-], at ``joint``.
        joint: Which one.
        saturated_fraction: Share of the time in which a torque was cut [-].
        tilt_error_deg: Largest [deg].
        slip_mm: Largest of all contacts [mm].
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


def capacities(
    scenario: Scenario, control: Control, progress: Progress | None = None
) -> tuple[Capacity, ...]:
    """What can be pivoted, if the scenario has supports, and what can be lifted, without them.

    Args:
        scenario: The scene; its object's mass is where the search starts from.
        control: The controller, whose margins count.
        progress: Called with tilts done and tilts in total.

    Raises:
        PathError: The arms cannot follow the path.
    """
    scenes = [("lift", lifted(scenario))]
    if scenario.supports:
        scenes.insert(0, ("pivot", scenario))
    found = []
    for i, (manoeuvre, scene) in enumerate(scenes):

        def report(done: int, total: int, before: int = i) -> None:
            if progress is not None:
                progress(before * total + done, len(scenes) * total)

        found.append(_capacity(manoeuvre, PathProblems(scene, control), report))
    return tuple(found)


def _capacity(
    manoeuvre: str, problems: PathProblems, progress: Callable[[int, int], None]
) -> Capacity:
    synthesizer = Synthesizer()

    def span(tilt: float) -> tuple[float, float]:
        try:
            return weight_range(problems.problem(tilt), problems.gravity(tilt), synthesizer)
        except InfeasibleError:
            return 0.0, 0.0

    tilts = problems.tilts(_STEP_DEG)
    spans = []
    for done, tilt in enumerate(tilts, start=1):
        spans.append(span(float(tilt)))
        progress(done, len(tilts))
    weights = [heaviest for _, heaviest in spans]
    first = int(np.argmin(weights))
    tilt, weight = float(tilts[first]), weights[first]
    if 0.0 < weight < math.inf:
        around = tilts[max(first - 1, 0)], tilts[min(first + 1, len(tilts) - 1)]
        refined = minimize_scalar(
            lambda t: span(float(t))[1],
            bounds=around,
            method="bounded",
            options={"xatol": _TILT_DEG},
        )
        if refined.fun < weight:
            tilt, weight = float(refined.x), float(refined.fun)
    limit, within = None, 0.0
    if math.isfinite(weight):
        gravity = problems.gravity(tilt)
        found = change(Kind.WEIGHT, problems.problem(tilt), gravity, synthesizer)
        within = found.confirmed_within
        if found.conflict is not None:
            limit = conflict(found.conflict, gravity, problems.orientation(tilt))
    return Capacity(
        manoeuvre=manoeuvre,
        weight=weight,
        mass=weight / GRAVITY,
        tilt_deg=tilt,
        lightest=max(lightest for lightest, _ in spans),
        conflict=limit,
        confirmed_within=within,
        tilts_deg=tuple(map(float, tilts)),
        weights=tuple(map(float, weights)),
    )


def confirm(
    scenario: Scenario,
    controller: str,
    control: Control,
    capacity: float,
    share: float,
    progress: Progress | None = None,
) -> Trial:
    """Runs the closed loop with a share of the capacity; the inertia grows with the mass.

    Args:
        scenario: The scene.
        controller: Name of the controller.
        control: Its settings.
        capacity: [N].
        share: Of it [-].
        progress: Called with steps done and steps in total.

    Raises:
        PathError: The arms cannot follow the path.
    """
    thing, weight = scenario.object, share * capacity
    heavy = thing.weighing(weight / (thing.mass * GRAVITY))
    request = Request(replace(scenario, object=heavy), controller, control, anyway=True)
    report = execute(request, progress).report
    return Trial(
        share=share,
        weight=weight,
        verdict=report.verdict,
        failures=report.failures,
        failed_syntheses=report.synthesis.failures,
        syntheses=report.synthesis.solves,
        torque_utilisation=report.torque.max_utilisation,
        joint=report.torque.joint,
        saturated_fraction=report.torque.saturated_fraction,
        tilt_error_deg=report.tilt.max_error_deg,
        slip_mm=max(c.slip_mm for c in report.contacts.values()),
    )
