r"""Forces with one load of a path problem whose timing and grip are given.

The remaining problem, separate for every station, is

.. math::

    \text{minimise}\quad   & \lambda \\
    \text{subject to}\quad & \|f_i\| \le s\,f_{n,i} + \lambda \text{ at every contact} \\
                           & \text{equilibrium, (16), and (7) at the environment}

and forces exist if :math:`\lambda \le 0`. Known forces with another load often need only a small
change: the least one that restores equilibrium, weighted by the size of each contact's cone,
:math:`\Delta F = D^2 G^T (G D^2 G^T)^{-1} r`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fulcrum.synthesis.arrays import Array, Indices, Mask, N
from fulcrum.synthesis.path.form import PathForm
from fulcrum.synthesis.path.problem import Load, PathObjective, PathProblem
from fulcrum.synthesis.path.solution import InfeasiblePathError
from fulcrum.synthesis.path.synthesizer import solve_form

# Largest imbalance, as a share of the load [-].
_BALANCED = 1e-9
# Regularisation of a matrix's diagonal, as a share of its trace [-].
_REGULAR = 1e-12


class GivenMotion:
    """Timing and grip of a path, for which forces with other loads are sought.

    Attributes:
        iterations: Interior-point iterations so far.
        solve_s: Time inside the solver so far [s].
    """

    def __init__(self, problem: PathProblem, b: Array, grip: Array, used: float) -> None:
        """Set timing and grip.

        Args:
            problem: The path; its loads and objective are not used.
            b: Squared rate of s at the grid points [1/s^2], (K,).
            grip: Normal forces of the n hands at the stations [N], (S, n).
            used: Share of the friction that may be used [-].
        """
        self._problem, self._b, self._grip, self._used = problem, b, grip, used
        self._point, interval = problem.stations.T
        a = np.diff(b) / (2.0 * np.diff(problem.s))
        self._motion = np.stack([a[interval], b[self._point]])
        self.iterations, self.solve_s = 0, 0.0

    def forces(self, load: Load, known: list[Array]) -> tuple[float, Array]:
        """Return the lack of friction at the worst station, in units of the load, and forces.

        The lack is infinite, and the forces are void, if another limit cannot be satisfied.

        Args:
            load: The load.
            known: Forces with other loads, (S, m, 6) each, from which to start.
        """
        balance = _Balance(self._problem, load, self._point, self._motion)
        result, lacking = known[0].copy(), np.ones(len(self._point), bool)
        for w_OC_C in known:
            changed = balance.restored(w_OC_C)
            serves = lacking & balance.kept(changed, self._used)
            result[serves] = changed[serves]
            lacking &= ~serves
        if not lacking.any():
            return 0.0, result
        least, result[lacking] = self._sought(load, lacking)
        return least, result

    def _sought(self, load: Load, where: Mask) -> tuple[float, Array]:
        """Return the same for some stations, from the solver."""
        hands, stations = load.problems[0].hands, int(where.sum())
        # The grip is given, so the bounds of the hands do not apply.
        contacts = tuple(
            replace(contact, f_n_min=0.0, f_n_max=math.inf) if i in hands else contact
            for i, contact in enumerate(load.problems[0].contacts)
        )
        free = replace(load, problems=tuple(replace(p, contacts=contacts) for p in load.problems))
        alone = replace(
            self._problem,
            loads=(free,),
            objective=PathObjective.FRICTION_MARGIN,
            duration=math.inf,
            timing=self._b,
        )
        form = PathForm(alone, grip=self._grip[where], where=where)
        slack = [np.full((stations, len(contacts)), form.unit)]
        try:
            found = solve_form(form, self._used, slack, ("Solved",))
        except InfeasiblePathError:
            return math.inf, np.zeros((stations, len(contacts), 6))
        self.iterations += found.iterations
        self.solve_s += found.solve_s
        return found.least, form.wrenches(found.every)[0]


class _Balance:
    """Equilibrium and limits of one load at all stations."""

    def __init__(self, problem: PathProblem, load: Load, point: Indices, motion: Array) -> None:
        self._load, self._point, self._facts = load, point, load.problems[0].contact_set
        self._own, self._motion = problem.inertial_torques, motion
        self._G = load.G[point].transpose(0, 2, 1, 3).reshape(len(point), 6, -1)
        a, b = motion[:, :, None]
        self._w_rest = load.w_ext_B[point] - load.w_a_B[point] * a - load.w_b_B[point] * b

    def restored(self, w_OC_C: Array) -> Array:
        """Return the nearest forces in equilibrium, with the hands' normal forces unchanged."""
        facts, shape = self._facts, w_OC_C.shape
        # Half a cone's width along each of its axes; a support's normal force counts as 1.
        size = facts.reciprocal.copy()
        size[size > 0.0] = 1.0 / size[size > 0.0]
        size[list(facts.hands), N] = 0.0
        D = (np.maximum(w_OC_C[..., N], 0.0)[..., None] * size).reshape(shape[0], -1)
        GD = self._G * D[:, None]
        flat = w_OC_C.reshape(shape[0], -1)
        r = -(np.einsum("sij,sj->si", self._G, flat) + self._w_rest)
        matrix = GD @ GD.transpose(0, 2, 1)
        # This keeps the matrix regular if no contact bears a component; `kept` rejects that case.
        matrix += _REGULAR * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(6)
        x = np.linalg.solve(matrix, r[..., None])
        return (flat + D * (GD.transpose(0, 2, 1) @ x)[..., 0]).reshape(shape)

    def kept(self, w_OC_C: Array, used: float) -> Mask:
        """Return where forces are in equilibrium and within all limits, (S,)."""
        facts, point, f_n = self._facts, self._point, w_OC_C[..., N]
        flat = w_OC_C.reshape(len(point), -1)
        error = np.abs(np.einsum("sij,sj->si", self._G, flat) + self._w_rest).max(axis=1)
        kept = error <= _BALANCED * self._load.unit
        kept &= (np.linalg.norm(w_OC_C * facts.friction, axis=2) <= used * f_n).all(axis=1)
        supports = np.setdiff1d(np.arange(f_n.shape[1]), facts.hands)
        bounded = f_n[:, supports]
        kept &= (bounded >= facts.f_n_min[supports]).all(axis=1)
        kept &= (bounded <= facts.f_n_max[supports]).all(axis=1)
        if self._own is None:
            return kept
        J = np.stack([joints.J_C for joints in self._load.joints])[point]
        tau = np.stack([joints.tau_g for joints in self._load.joints])[point]
        tau = tau + np.einsum("snkl,snk->sl", J, w_OC_C[:, list(facts.hands)])
        tau = self._own.at(point).added_to(tau, *self._motion)
        kept &= (tau <= self._load.tau_max[point]).all(axis=1)
        kept &= (tau >= self._load.tau_min[point]).all(axis=1)
        return kept
