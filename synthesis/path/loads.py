r"""Path problems with many loads, by cutting planes: only the loads that bind are solved together.

Of an uncertain object's loads few bind. So the problem is solved with few of them, and the others
are looked at one by one, in the timing and with the grip that were found
(:mod:`synthesis.path.forces`). The one that lacks most friction joins those that are solved
together. Once there are forces with every load the whole problem is solved, and no timing or grip
is better: it would be better for the fewer loads, too.

The loads to begin with are those that bind on a coarse grid, where all are solved together.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.path.forces import GivenMotion
from fulcrum.synthesis.path.problem import PathObjective, PathProblem
from fulcrum.synthesis.path.solution import ACTIVE, InfeasiblePathError, PathSolution
from fulcrum.synthesis.path.synthesizer import solve_path

# Points of the coarse grid, at most and as a share of all.
_COARSE, _SHARE = 21, 1.0 / 3.0
# What the solver's accuracy may add to a friction cone, in units of the largest load [-].
_SERVED = 1e-7
# From so many known forces those with another load are made, at most.
_KNOWN = 3


def solve_many(problem: PathProblem) -> PathSolution:
    """The optimal timing and grip, and forces with every load, as :func:`solve_path` finds them.

    With least effort all loads are solved together, which takes long for many.

    Raises:
        InfeasiblePathError: No timing and grip serve all loads; says where and which limits.
        UnboundedError: The objective improves without limit.
        SolverError: The solver gave neither, or repeated solves do not settle viscous friction.
    """
    # Effort counts with every load.
    if len(problem.loads) == 1 or problem.objective is PathObjective.LEAST_EFFORT:
        return solve_path(problem)
    chosen, points = [0], len(problem.s)
    count = min(_COARSE, round(_SHARE * points))
    if count > 2:
        coarse = np.linspace(0, points - 1, count).round().astype(int)
        # Where a coarse grid leaves no room the fine one decides.
        with contextlib.suppress(InfeasiblePathError):
            chosen = _binding(solve_path(problem.at(coarse)))
    search = _Search(problem, chosen)
    search.run()
    return search.solution()


def _binding(found: PathSolution) -> list[int]:
    """The first load, and those that use up friction, a torque or a support's normal force."""
    margin = found.problem.objective is PathObjective.FRICTION_MARGIN
    hands = found.problem.loads[0].problems[0].hands
    names = [found.problem.loads[0].problems[0].contacts[i].name for i in hands]
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


class _Search:
    """Loads that are solved together, and forces with the others."""

    def __init__(self, problem: PathProblem, chosen: list[int]) -> None:
        self._problem, self._chosen = problem, list(chosen)
        self._iterations, self._solve_s = 0, 0.0

    def run(self) -> None:
        """Adds the load that lacks most, until none does."""
        while True:
            self._solve()
            lacking = self._lacking()
            worst = max(lacking, key=lambda i: lacking[i], default=0)
            if lacking.get(worst, 0.0) <= _SERVED:
                return
            self._chosen.append(worst)

    def _solve(self) -> None:
        loads = tuple(self._problem.loads[i] for i in self._chosen)
        self._found = found = solve_path(replace(self._problem, loads=loads))
        self._served = dict(zip(self._chosen, found.w_OC_C, strict=True))
        self._iterations += found.iterations
        self._solve_s += found.solve_s

    def _lacking(self) -> dict[int, float]:
        """How much friction each other load lacks, in units of the load; forces with them."""
        found, loads = self._found, self._problem.loads
        margin = self._problem.objective is PathObjective.FRICTION_MARGIN
        grip = found.w_OC_C[0][:, list(loads[0].problems[0].hands), N]
        motion = GivenMotion(self._problem, found.b, grip, found.value if margin else 1.0)
        lacking, known = {}, list(self._chosen)
        for i in range(len(loads)):
            if i not in self._chosen:
                near = sorted(known, key=lambda j: self._apart(i, j))[:_KNOWN]
                forces = [self._served[j] for j in near]
                lacking[i], self._served[i] = motion.forces(loads[i], forces)
                if lacking[i] <= _SERVED:
                    known.append(i)
        self._iterations += motion.iterations
        self._solve_s += motion.solve_s
        return lacking

    def _apart(self, i: int, j: int) -> float:
        """How different two loads are, by their weights half way [N, N·m]."""
        half = len(self._problem.s) // 2
        one, other = (self._problem.loads[k].problems[half].w_ext_O for k in (i, j))
        return float(np.abs(one - other).sum())

    def solution(self) -> PathSolution:
        """The solution with forces for every load."""
        return replace(
            self._found,
            problem=self._problem,
            w_OC_C=tuple(self._served[i] for i in range(len(self._problem.loads))),
            iterations=self._iterations,
            solve_s=self._solve_s,
        )
