"""The heaviest object that a scenario's robot can pivot, and lift, as optimisation over its weight.

At each tilt the largest weight that contacts and joints can hold is the optimum of one second-order
cone program. The capacity is the least of these over the path. The certificate of infeasibility
just above it shows what limits it. Runs in closed loop only confirm the capacity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from fulcrum.sim.geometry import GRAVITY
from fulcrum.sim.planning import PathProblems
from fulcrum.sim.scenario import Control, Scenario, lifted
from fulcrum.sim.signals import Progress
from fulcrum.synthesis import InfeasibleError, Synthesizer
from fulcrum.synthesis.analysis import Conflict, Kind, change, weight_range
from fulcrum.synthesis.analysis.conflict import conflict
from fulcrum.synthesis.render import Marked, Page, page

_STEP_DEG = 1.0
# Accuracy of the tightest tilt [deg].
_TILT_DEG = 1e-3


@dataclass(frozen=True)
class Capacity:
    """The heaviest object in one manoeuvre, with the controller's margins.

    Attributes:
        manoeuvre: pivot or lift.
        weight: Largest weight that can be held at every tilt of the path [N]; infinite if any can.
        mass: Mass of that weight [kg].
        tilt_deg: Tilt that limits the weight [deg].
        lightest: Least weight that can be held at every tilt [N]; above 0 if preloads need it.
        conflict: What limits the weight at that tilt; None if nothing does.
        confirmed_within: Relative distance to the weight at which a second solve still tells
            feasible from infeasible [-].
        tilts_deg: Grid of tilts [deg].
        weights: Largest weight at each tilt [N]; 0 where none can be held.
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

    def page(self) -> Page:
        """Return the capacity, what limits it, and how well that is confirmed as a page."""
        if self.weight == math.inf:
            return page(f"{self.manoeuvre}: any weight, as nothing limits the grip")
        curve = dict(zip(self.tilts_deg, self.weights, strict=True))
        end = max(curve)
        lightest = limited = confirmed = ""
        if self.lightest > 0.0:
            lightest = f"  at least {self.lightest:.4g} N, or the preloads would move the object"
        if self.conflict is not None:
            limits, balances = ", ".join(self.conflict.limits), ", ".join(self.conflict.balances)
            limited = f"  limited by {limits}; beyond, these fail: {balances}"
        if self.weight > 0.0 and math.isfinite(self.confirmed_within):
            confirmed = (
                "  confirmed: feasible below and infeasible above, at a relative distance of "
                f"{self.confirmed_within:.0e}"
            )
        elif self.weight > 0.0:
            confirmed = "  not confirmed by solving again below and above"
        return page(
            (
                Marked(self.manoeuvre),
                f": {self.weight:.4g} N ({self.mass:.4g} kg), limited at {self.tilt_deg:.4g} deg; "
                f"at 0 deg {curve[0.0]:.4g} N, at {end:g} deg {curve[end]:.4g} N, "
                f"at the best tilt {max(curve.values()):.4g} N",
            ),
            lightest,
            limited,
            confirmed,
        )


def capacities(
    scenario: Scenario, control: Control, progress: Progress | None = None
) -> tuple[Capacity, ...]:
    """Return the capacity for pivoting, if there are supports, and that for lifting without them.

    Args:
        scenario: Scene; the search starts at the mass of its object.
        control: Settings of the controller, which give the margins.
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
