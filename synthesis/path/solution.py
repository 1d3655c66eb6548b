"""Timing and forces of a path, with residuals that are computed without the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fulcrum.synthesis import FulcrumError
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.contact import utilisation
from fulcrum.synthesis.path.problem import PathProblem

# Share of a limit from which on a constraint counts as active.
ACTIVE = 0.999


@dataclass(frozen=True)
class PathResiduals:
    """Residuals of the path problem and of its optimality conditions.

    Attributes:
        primal: Largest imbalance as a share of the largest load, or excess over a limit as a share
            of it [-]; viscous friction by the exact rate.
        dual: Largest violation of stationarity and dual cones, in the solver's units [-].
        gap: |primal value - dual value| relative to the value [-].
    """

    primal: float
    dual: float
    gap: float


@dataclass(frozen=True, eq=False)
class PathSolution:
    """An optimal timing of a path and the forces along it.

    Stations are the ends of the intervals, see :attr:`PathProblem.stations`.

    Attributes:
        problem: The problem that was solved.
        value: Optimal objective: duration [s], mean squared effort [-] or friction utilisation [-].
        b: Squared rate of s at the grid points [1/s^2], (K,).
        w_OC_C: Wrenches on each load in contact axes [N, N·m], (S, m, 6).
        dual, gap: See :class:`PathResiduals`.
        iterations: Interior-point iterations, summed over all solves.
        solve_s: Time inside the solver, set-up included [s].
    """

    problem: PathProblem
    value: float
    b: Array
    w_OC_C: tuple[Array, ...]
    dual: float
    gap: float
    iterations: int
    solve_s: float

    @cached_property
    def a(self) -> Array:
        """Return the acceleration of s in each interval [1/s^2], (K - 1,)."""
        return np.diff(self.b) / (2.0 * np.diff(self.problem.s))

    @cached_property
    def times(self) -> Array:
        """Return the time at which each grid point is reached [s], (K,)."""
        rate = np.sqrt(self.b)
        steps = 2.0 * np.diff(self.problem.s) / (rate[:-1] + rate[1:])
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def duration(self) -> float:
        """Return the duration of the whole path [s]."""
        return float(self.times[-1])

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """Return a and b at the stations [1/s^2], (S,) each."""
        point, interval = self.problem.stations.T
        return np.append(self.a, 0.0)[interval], self.b[point]

    @cached_property
    def tau(self) -> tuple[Array, ...]:
        """Return the joint torques with each load [N·m or N], (S, l); empty without joints."""
        point, own = self.problem.stations[:, 0], self.problem.inertial_torques
        found = []
        for load, w_OC_C in zip(self.problem.loads, self.w_OC_C, strict=True):
            still = [load.problems[k].torque(w) for k, w in zip(point, w_OC_C, strict=True)]
            tau = np.array(still)
            found.append(tau if own is None else own.at(point).added_to(tau, *self.motion))
        return tuple(found)

    @cached_property
    def utilisation(self) -> tuple[Array, ...]:
        """Return the friction utilisation of each contact [-], (S, m), with each load."""
        pairs = zip(self.problem.loads, self.w_OC_C, strict=True)
        return tuple(utilisation(load.problems[0].contacts, w) for load, w in pairs)

    @cached_property
    def shares(self) -> dict[str, Array]:
        """Return the used share of each limit [-], (S,), by name, with the load that uses most."""
        found: dict[str, Array] = {}
        for i in range(len(self.problem.loads)):
            for name, share in self.shares_with(i).items():
                found[name] = np.maximum(found.get(name, -np.inf), share)
        point = self.problem.stations[:, 0]
        a, b = self.motion
        if (rates := self.problem.rates) is not None:
            speeds = np.abs(rates.slopes[point]) * np.sqrt(b)[:, None] / rates.limits
            found |= {f"speed of {n}": s for n, s in zip(rates.names, speeds.T, strict=True)}
        if (limited := self.problem.accelerations) is not None:
            vectors = limited.slopes[point] * a[:, None, None]
            vectors = vectors + limited.curvatures[point] * b[:, None, None]
            sizes = (np.linalg.norm(vectors, axis=2) / limited.limits).T
            found |= {f"acceleration of {n}": s for n, s in zip(limited.names, sizes, strict=True)}
        return found

    def shares_with(self, i: int) -> dict[str, Array]:
        """Return the used shares of the limits of forces and torques with load i [-], (S,)."""
        load, point, w_OC_C = self.problem.loads[i], self.problem.stations[:, 0], self.w_OC_C[i]
        facts = load.problems[0].contact_set
        found = {}
        for j, contact in enumerate(load.problems[0].contacts):
            found[f"friction of {contact.name}"] = self.utilisation[i][:, j]
            f_n = w_OC_C[:, j, N]
            if facts.f_n_min[j] > 0.0:
                found[f"f_n_min of {contact.name}"] = 2.0 - f_n / facts.f_n_min[j]
            if np.isfinite(facts.f_n_max[j]):
                found[f"f_n_max of {contact.name}"] = f_n / facts.f_n_max[j]
        if load.joints:
            tau, low, high = self.tau[i], load.tau_min[point], load.tau_max[point]
            middle = np.where(np.isfinite(low + high), (low + high) / 2.0, 0.0)
            used = np.maximum((tau - middle) / (high - middle), (middle - tau) / (middle - low))
            found |= {f"torque of {n}": used[:, j] for j, n in enumerate(load.joints[0].names)}
        return found

    def active(self) -> list[tuple[str, ...]]:
        """Return the names of the limits that are used up, at each of the S stations."""
        used = np.array(list(self.shares.values())) >= ACTIVE
        names = np.array(list(self.shares))
        return [tuple(map(str, names[column])) for column in used.T]

    @cached_property
    def residuals(self) -> PathResiduals:
        """Return the residuals of the constraints and of the optimality conditions."""
        excess = max((float(share.max()) - 1.0 for share in self.shares.values()), default=0.0)
        late = self.duration / self.problem.duration - 1.0
        return PathResiduals(max(excess, late, self.imbalance), self.dual, self.gap)

    @cached_property
    def imbalance(self) -> float:
        """Return the largest imbalance of an object as a share of its largest load [-]."""
        a, b = self.motion
        point, worst = self.problem.stations[:, 0], 0.0
        for load, w_OC_C in zip(self.problem.loads, self.w_OC_C, strict=True):
            balance = np.einsum("smkj,smj->sk", load.G[point], w_OC_C) + load.w_ext_B[point]
            balance -= load.w_a_B[point] * a[:, None] + load.w_b_B[point] * b[:, None]
            worst = max(worst, float(np.abs(balance).max()) / load.unit)
        return worst


class InfeasiblePathError(FulcrumError):
    """No timing and forces satisfy all constraints along the path.

    Attributes:
        binding: The limits with the largest multipliers, each with its place s on the path.
    """

    def __init__(self, binding: list[tuple[str, float]]) -> None:
        self.binding = binding
        named = [name if math.isnan(s) else f"{name} at s = {s:.4g}" for name, s in binding]
        super().__init__(
            "no timing and forces along the path keep all limits; "
            f"most binding: {', '.join(named)}."
        )
