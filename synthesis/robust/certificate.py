r"""Proof, checked without the solver, that no grip serves all worlds of a robust problem.

The Lagrangian of the robust problem is the sum of those of its worlds (:mod:`synthesis.solution`).
It proves infeasibility if the sum is positive and its gradient vanishes. For the normal forces of
the hands, which all worlds share, this is the gradient of the sum; for all other forces it is the
gradient of each world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fulcrum.synthesis import FulcrumError, Multipliers, Problem
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.solution import heaviest


@dataclass(frozen=True, eq=False)
class RobustCertificate:
    """Multipliers of all worlds whose Lagrangian is always positive.

    Attributes:
        problems: The worlds.
        multipliers: The multipliers of each world, scaled so that their values sum to 1.
    """

    problems: tuple[Problem, ...]
    multipliers: tuple[Multipliers, ...]

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Return the value of each world's Lagrangian at zero forces; a proof has a sum > 0."""
        return tuple(y.value(p) for p, y in zip(self.problems, self.multipliers, strict=True))

    @cached_property
    def residual(self) -> float:
        """Return the summed violations of stationarity and dual cones; a proof has << 1."""
        hands = list(self.problems[0].hands)
        common, total = np.zeros(len(hands)), 0.0
        for problem, multipliers in zip(self.problems, self.multipliers, strict=True):
            gradient = multipliers.stationarity(problem)
            common += gradient[hands, N]
            gradient[hands, N] = 0.0
            outside = max(multipliers.cone_violation(problem), 0.0)
            limits = 2 * (len(problem.contacts) + multipliers.tau_max.size)
            total += float(np.abs(gradient).sum()) + limits * outside
        return total + float(np.abs(common).sum())

    def proves(self, force_bound: float) -> bool:
        """Return whether no forces with components up to a bound [N, N·m] serve all worlds.

        The Lagrangian at feasible forces is at most 0, and at least ``value - residual * bound``
        minus the contribution of multipliers outside their dual cones. Twice that covers both.
        """
        return sum(self.values) > 2.0 * self.residual * force_bound

    @cached_property
    def weights(self) -> dict[str, float]:
        """Return the size of each constraint's multipliers, summed over the worlds, by name."""
        total: dict[str, float] = {}
        for problem, multipliers in zip(self.problems, self.multipliers, strict=True):
            for name, weight in multipliers.weights(problem).items():
                total[name] = total.get(name, 0.0) + weight
        return total

    def heaviest(self, count: int) -> list[str]:
        """Return the names of the constraints with the largest multipliers, heaviest first."""
        return heaviest(self.weights, count)


def robust_certificate(
    problems: tuple[Problem, ...], rays: Sequence[Multipliers]
) -> RobustCertificate:
    """Return the certificate of an unbounded ray of multipliers, scaled to a value of 1."""
    rays = [replace(ray, gradient=np.zeros(0)) for ray in rays]
    value = abs(sum(ray.value(p) for p, ray in zip(problems, rays, strict=True))) or 1.0
    return RobustCertificate(problems, tuple(ray.over(value) for ray in rays))


class RobustInfeasibleError(FulcrumError):
    """No normal forces of the hands serve all worlds; `certificate` is the Farkas proof."""

    def __init__(self, certificate: RobustCertificate) -> None:
        self.certificate = certificate
        super().__init__(
            f"no normal forces of the hands serve all {len(certificate.problems)} worlds; "
            f"most binding: {', '.join(certificate.heaviest(3))}."
        )
