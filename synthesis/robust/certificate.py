r"""Proof, checked without the solver, that no grip serves all worlds of a robust problem.

The Lagrangian of the robust problem is the sum of those of its worlds (:mod:`synthesis.solution`).
It is a proof of infeasibility where the sum is positive and its gradient vanishes: in the normal
forces of the hands, which the worlds have in common, that of the sum; in all other forces that of
each world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from fulcrum.synthesis import FulcrumError, Multipliers, Problem
from fulcrum.synthesis.arrays import N


@dataclass(frozen=True, eq=False)
class RobustCertificate:
    """Multipliers of all worlds whose Lagrangian is always positive.

    Attributes:
        problems: The worlds.
        multipliers: Those of each, scaled so that their values sum to 1.
    """

    problems: tuple[Problem, ...]
    multipliers: tuple[Multipliers, ...]

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Value of each world's Lagrangian at zero forces; their sum is positive in a proof."""
        pairs = zip(self.problems, self.multipliers, strict=True)
        return tuple(multipliers.value(problem) for problem, multipliers in pairs)

    @cached_property
    def residual(self) -> float:
        """Violations of stationarity and dual cones, summed, for a value of 1; proves if << 1."""
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
        """Whether no forces with components up to a bound [N, N·m] serve all worlds.

        The Lagrangian at feasible forces is at most 0, but at least ``value - residual * bound``
        less what multipliers outside their dual cones may add; both are covered by twice that.
        """
        return sum(self.values) > 2.0 * self.residual * force_bound

    @cached_property
    def weights(self) -> dict[str, float]:
        """Size of each constraint's multipliers, summed over the worlds, by its name."""
        total: dict[str, float] = {}
        for problem, multipliers in zip(self.problems, self.multipliers, strict=True):
            for name, weight in multipliers.weights(problem).items():
                total[name] = total.get(name, 0.0) + weight
        return total

    def heaviest(self, count: int) -> list[str]:
        """Names of the constraints with the largest multipliers, heaviest first."""
        weights = self.weights
        return sorted((n for n in weights if weights[n] > 0.0), key=lambda n: -weights[n])[:count]


def robust_certificate(
    problems: tuple[Problem, ...], rays: Sequence[Multipliers]
) -> RobustCertificate:
    """The certificate made of an unbounded ray of multipliers, scaled to a value of 1."""
    rays = [replace(ray, gradient=np.zeros(0)) for ray in rays]
    value = abs(sum(ray.value(p) for p, ray in zip(problems, rays, strict=True))) or 1.0
    names = [field.name for field in fields(Multipliers)]
    return RobustCertificate(
        problems=problems,
        multipliers=tuple(
            Multipliers(**{name: getattr(ray, name) / value for name in names}) for ray in rays
        ),
    )


class RobustInfeasibleError(FulcrumError):
    """No normal forces of the hands serve all worlds; carries the Farkas certificate."""

    def __init__(self, certificate: RobustCertificate) -> None:
        self.certificate = certificate
        super().__init__(
            f"no normal forces of the hands serve all {len(certificate.problems)} worlds; "
            f"most binding: {', '.join(certificate.heaviest(3))}."
        )
