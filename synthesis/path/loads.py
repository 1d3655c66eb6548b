r"""Path problems with many loads, by cutting planes: only the loads that bind are solved together.

Few loads of an uncertain object bind. So the problem is solved with few loads, and the others are
checked one by one with the timing and grip that were found (:mod:`synthesis.path.forces`). The load
that lacks most friction is added, and the problem is solved again. When forces exist for every
load, the timing and grip are optimal: better ones would be better for the fewer loads, too.

The first loads are those that bind on a coarse grid, where all are solved together.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.path.forces import GivenMotion
from fulcrum.synthesis.path.problem import PathObjective, PathProblem
from fulcrum.synthesis.path.solution import ACTIVE, InfeasiblePathError, PathSolution
from fulcrum.synthesis.path.synthesizer import solve_path

# Number of points of the coarse grid, and its largest share of all points.
_COARSE, _SHARE = 21, 1.0 / 3.0
# Lack of friction that is solver accuracy, in units of the largest load [-].
_SERVED = 1e-7
# Largest number of known forces from which those with another load are made.
_KNOWN = 3


def solve_many(problem: PathProblem) -> PathSolution:
    """Return the optimal timing and grip with forces for every load, as :func:`solve_path` does.

    For least effort all loads are solved together, which is slow for many loads.

    Raises:
        InfeasiblePathError: No timing and grip serve all loads; names limits and places.
        UnboundedError: The objective improves without limit.
        SolverError: The solver found neither, or repeated solves do not settle viscous friction.
    """
    # The effort of every load is part of the objective.
    if len(problem.loads) == 1 or problem.objective is PathObjective.LEAST_EFFORT:
        return solve_path(problem)
    chosen, points = [0], len(problem.s)
    count = min(_COARSE, round(_SHARE * points))
    if count > 2:
        coarse = np.linspace(0, points - 1, count).round().astype(int)
        # If the coarse grid is infeasible, start with the first load.
        with contextlib.suppress(InfeasiblePathError):
            chosen = _binding(solve_path(problem.at(coarse)))
    iterations, solve_s = 0, 0.0
    while True:
        found = solve_path(replace(problem, loads=tuple(problem.loads[i] for i in chosen)))
        served = dict(zip(chosen, found.w_OC_C, strict=True))
        margin = problem.objective is PathObjective.FRICTION_MARGIN
        grip = found.w_OC_C[0][:, list(problem.loads[0].problems[0].hands), N]
        motion = GivenMotion(problem, found.b, grip, found.value if margin else 1.0)
        lacking = _lacking(motion, problem, served)
        iterations += found.iterations + motion.iterations
        solve_s += found.solve_s + motion.solve_s
        worst = max(lacking, key=lambda i: lacking[i], default=0)
        if lacking.get(worst, 0.0) <= _SERVED:
            return replace(
                found,
                problem=problem,
                w_OC_C=tuple(served[i] for i in range(len(problem.loads))),
                iterations=iterations,
                solve_s=solve_s,
            )
        chosen.append(worst)


def _binding(found: PathSolution) -> list[int]:
    """Return the first load and those that use up friction, a torque or a support's force."""
    margin = found.problem.objective is PathObjective.FRICTION_MARGIN
    first = found.problem.loads[0].problems[0]
    names = [first.contacts[i].name for i in first.hands]
    common = [f"{bound} of {name}" for bound in ("f_n_min", "f_n_max") for name in names]
    chosen = [0]
    for i in range(1, len(found.problem.loads)):
        used = max(
            float(share.max()) / (found.value if margin and name.startswith("friction") else 1.0)
            for name, share in found.shares_with(i).items()
            if name not in common
        )
        if used >= ACTIVE:
            chosen.append(i)
    return chosen


def _lacking(
    motion: GivenMotion, problem: PathProblem, served: dict[int, Array]
) -> dict[int, float]:
    """Return how much friction each other load lacks, in units of the load.

    Args:
        motion: Timing and grip.
        problem: Problem with all loads.
        served: Forces with the loads that were solved together; those with the others are added.
    """
    # Two loads differ by their weights half way [N, N·m].
    half = [load.problems[len(problem.s) // 2].w_ext_O for load in problem.loads]
    lacking, known, chosen = {}, list(served), list(served)
    for i, load in enumerate(problem.loads):
        if i not in chosen:
            near = sorted(known, key=lambda j: float(np.abs(half[i] - half[j]).sum()))[:_KNOWN]
            lacking[i], served[i] = motion.forces(load, [served[j] for j in near])
            if lacking[i] <= _SERVED:
                known.append(i)
    return lacking
