"""A path's timing and forces as found, with residuals that are computed without the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fulcrum.synthesis import FulcrumError
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.contact import ContactSet, utilisation
from fulcrum.synthesis.path.problem import PathProblem

# From this share of a limit on a constraint counts as active.
ACTIVE = 0.999


@dataclass(frozen=True)
class PathResiduals:
    """How well a solution keeps the path problem and its optimality conditions.

    Attributes:
        primal: Largest imbalance of the object as a share of the largest load, or excess over a
            limit as a share of it [-]; viscous friction by the exact rate.
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
        problem: What was solved.
        value: Optimal objective: duration [s], mean squared effort [-] or friction utilisation [-].
        b: Squared rate of s at the grid points [1/s^2], (K,).
        w_OC_C: Wrenches with each load, on it, in contact axes [N, N·m], (S, m, 6).
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
        """Acceleration of s in each interval [1/s^2], (K - 1,)."""
        return np.diff(self.b) / (2.0 * np.diff(self.problem.s))

    @cached_property
    def times(self) -> Array:
        """When each grid point is reached [s], (K,)."""
        rate = np.sqrt(self.b)
        steps = 2.0 * np.diff(self.problem.s) / (rate[:-1] + rate[1:])
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def duration(self) -> float:
        """Duration of the whole path [s]."""
        return float(self.times[-1])

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """a and b at the stations [1/s^2], (S,) each."""
        point, interval = self.problem.stations.T
        return np.append(self.a, 0.0)[interval], self.b[point]

    @cached_property
    def tau(self) -> tuple[Array, ...]:
        """Joint torques [N·m or N] with each load, (S, l) each; empty without joints."""
        point = self.problem.stations[:, 0]
        a, b = self.motion
        found = []
        for load, w_OC_C in zip(self.problem.loads, self.w_OC_C, strict=True):
            still = [load.problems[k].torque(w) for k, w in zip(point, w_OC_C, strict=True)]
            tau, own = np.array(still), self.problem.inertial_torques
            if own is not None:
                tau = tau + own.tau_a[point] * a[:, None] + own.tau_b[point] * b[:, None]
                tau = tau + own.tau_c[point] * np.sqrt(b)[:, None]
            found.append(tau)
        return tuple(found)

    @cached_property
    def utilisation(self) -> tuple[Array, ...]:
        """Friction utilisation of each contact [-], (S, m), with each load."""
        pairs = zip(self.problem.loads, self.w_OC_C, strict=True)
        return tuple(utilisation(load.problems[0].contacts, w) for load, w in pairs)

    @cached_property
    def shares(self) -> dict[str, Array]:
        """How much of each limit is used [-], (S,), by its name; with the load that uses most."""
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
            sizes = np.linalg.norm(vectors, axis=2) / limited.limits
            found |= {
                f"acceleration of {n}": s for n, s in zip(limited.names, sizes.T, strict=True)
            }
        return found

    def shares_with(self, i: int) -> dict[str, Array]:
        """The same of forces and torques with one load, by its index."""
        load, point, w_OC_C = self.problem.loads[i], self.problem.stations[:, 0], self.w_OC_C[i]
        facts = ContactSet.of(load.problems[0].contacts)
        found = {}
        for j, contact in enumerate(load.problems[0].contacts):
            found[f"friction of {contact.name}"] = self.utilisation[i][:, j]
            f_n = w_OC_C[:, j, N]
            if facts.f_n_min[j] > 0.0:
                found[f"f_n_min of {contact.name}"] = 2.0 - f_n / facts.f_n_min[j]
            if np.isfinite(facts.f_n_max[j]):
                found[f"f_n_max of {contact.name}"] = f_n / facts.f_n_max[j]
        first = load.problems[0].joints
        for j, name in enumerate(() if first is None else first.names):
            joints = [load.problems[k].joints for k in point]
            tau = self.tau[i][:, j]
            low = np.array([each.tau_min[j] for each in joints if each is not None])
            high = np.array([each.tau_max[j] for each in joints if each is not None])
            middle = np.where(np.isfinite(low + high), (low + high) / 2.0, 0.0)
            up, down = (tau - middle) / (high - middle), (middle - tau) / (middle - low)
            found[f"torque of {name}"] = np.maximum(up, down)
        return found

    def active(self) -> list[tuple[str, ...]]:
        """Names of the limits that are used up, at each of the S stations."""
        used = np.array(list(self.shares.values())) >= ACTIVE
        names = np.array(list(self.shares))
        return [tuple(map(str, names[column])) for column in used.T]

    @cached_property
    def residuals(self) -> PathResiduals:
        """The proof: residuals of the constraints and of the optimality conditions."""
        excess = max((float(share.max()) - 1.0 for share in self.shares.values()), default=0.0)
        late = self.duration / self.problem.duration - 1.0
        return PathResiduals(max(excess, late, self.imbalance), self.dual, self.gap)

    @cached_property
    def imbalance(self) -> float:
        """Largest imbalance of an object as a share of its largest load [-]."""
        a, b = self.motion
        point, worst = self.problem.stations[:, 0], 0.0
        for load, w_OC_C in zip(self.problem.loads, self.w_OC_C, strict=True):
            G = np.stack([load.problems[k].G for k in point])
            w_ext = np.stack([load.problems[k].w_ext_B for k in point])
            balance = np.einsum("smkj,smj->sk", G, w_OC_C) + w_ext
            balance -= load.w_a_B[point] * a[:, None] + load.w_b_B[point] * b[:, None]
            unit = max(problem.load for problem in load.problems) or 1.0
            worst = max(worst, float(np.abs(balance).max()) / unit)
        return worst


class InfeasiblePathError(FulcrumError):
    """No timing and forces satisfy all constraints along the path.

    Attributes:
        binding: The limits that weigh most in the proof, each with its place s on the path.
    """

    def __init__(self, binding: list[tuple[str, float]]) -> None:
        self.binding = binding
        named = [name if math.isnan(s) else f"{name} at s = {s:.4g}" for name, s in binding]
        super().__init__(
            "no timing and forces along the path keep all limits; "
            f"most binding: {', '.join(named)}."
        )
