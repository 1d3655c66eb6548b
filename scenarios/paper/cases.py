"""The paper's two examples as problems over the tilt."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.scenarios.reading.library import scenario
from fulcrum.sim.planning import PathProblems
from fulcrum.sim.scenario import Pivot, Scenario
from fulcrum.synthesis import InfeasibleError, Objective, Solution, Synthesizer
from fulcrum.synthesis.arrays import Array, N

FORCE_OBJECTIVES = {
    "GFOP max": Objective.MAX_NORMAL_FORCE,
    "GFOP norm": Objective.NORM_NORMAL_FORCE,
}
TORQUE_OBJECTIVES = {"TOP max": Objective.MAX_TORQUE, "TOP norm": Objective.NORM_TORQUE}
PAPER_TILT_DEG = 85.0  # of the cylinder, where its figures end


@dataclass(frozen=True, eq=False)
class TiltCurve:
    """Solutions of a problem over the tilt, where it is feasible.

    Attributes:
        tilt_deg: Tilts [deg], (k,).
        normal: Normal forces of all contacts [N], (k, m).
        torque: Largest |torque| [N·m], (k,); zero without joints.
        solve_s: Wall time of each whole solve [s], (k,).
    """

    tilt_deg: Array
    normal: Array
    torque: Array
    solve_s: Array


def tilt_curve(problems: PathProblems, tilts_deg: Iterable[float]) -> TiltCurve:
    """Solve the problems at the tilts; leave out infeasible ones."""
    synthesizer = Synthesizer()
    rows: list[tuple[float, Solution]] = []
    for tilt_deg in tilts_deg:
        try:
            rows.append((tilt_deg, synthesizer.solve(problems.problem(tilt_deg))))
        except InfeasibleError:
            continue
    return TiltCurve(
        tilt_deg=np.array([tilt for tilt, _ in rows]),
        normal=np.array([solution.w_OC_C[:, N] for _, solution in rows]),
        torque=np.array([np.abs(solution.tau).max(initial=0.0) for _, solution in rows]),
        solve_s=np.array([solution.solve_s for _, solution in rows]),
    )


def paper_cylinder() -> Scenario:
    """Return the paper's cylinder: fingers at the very rim, tilted to 90 deg."""
    tilted = scenario("cylinder-tilt")
    rim = -tilted.supports[0].p_OP_O[0]
    at_rim = tuple(replace(hand, p_OC_O=(rim, *hand.p_OC_O[1:])) for hand in tilted.hands)
    assert isinstance(tilted.path, Pivot)
    return replace(tilted, hands=at_rim, path=replace(tilted.path, angle_deg=90.0))


def paper_box(up: float) -> Scenario:
    """Return the box with its hand contacts at a height above the edge [m]."""
    tilted = scenario("box-tilt")
    edge = tilted.supports[0].p_OP_O[2]
    hands = tuple(replace(hand, p_OC_O=(*hand.p_OC_O[:2], edge + up)) for hand in tilted.hands)
    return replace(tilted, hands=hands)
