"""Worlds that one grip has to serve: members of a set drawn without its own code, and a judge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fulcrum.synthesis import ContactModel, Problem
from fulcrum.synthesis.problem import Gravity
from fulcrum.synthesis.reference import ReferenceInfeasibleError, solve_reference
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet

# Fixed normal forces get this room [N], or the solver's own error would cut the forces off.
ROOM = 1e-5


def gravity_of(problem: Problem) -> Gravity:
    """The weight of a problem without other external forces, its centre of mass at the origin."""
    weight = float(np.linalg.norm(problem.w_ext_O[:3]))
    return Gravity(weight, problem.w_ext_O[:3] / weight, np.zeros(3))


def gripped(problem: Problem, f_n: np.ndarray) -> Problem:
    """The problem with the hands' normal forces fixed [N], (n,)."""
    contacts = list(problem.contacts)
    for i, f in zip(problem.hands, f_n.tolist(), strict=True):
        contacts[i] = replace(contacts[i], f_n_min=max(0.0, f - ROOM), f_n_max=f + ROOM)
    return replace(problem, contacts=tuple(contacts))


def is_served(problem: Problem, f_n: np.ndarray) -> bool:
    """Whether forces exist with these normal forces of the hands, by the CVXPY reference."""
    try:
        solve_reference(gripped(problem, f_n))
    except ReferenceInfeasibleError:
        return False
    return True


def member(
    rng: np.random.Generator, problem: Problem, gravity: Gravity, uncertainty: UncertaintySet
) -> Problem:
    """A random world of the set, all places but those of the hands included."""
    weight = gravity.weight * (1.0 + uncertainty.mass * rng.uniform(-1.0, 1.0))
    center = gravity.center_O + np.array(uncertainty.center) * rng.uniform(-1.0, 1.0, 3)
    # Inside the hull of pushes along the axes the relative components sum to 1 at most.
    f = np.array(uncertainty.push) * rng.dirichlet(np.ones(3)) * rng.choice([-1.0, 1.0], 3)
    # The sum of the lever's relative components along the axes but that of the push does, too.
    r = gravity.center_O
    moment = np.cross(r, f)
    for k in range(3):
        lever = np.array(uncertainty.lever) * rng.dirichlet(np.ones(3)) * rng.choice([-1.0, 1.0], 3)
        moment += np.cross(lever, f * np.eye(3)[k])
    pull = weight * gravity.direction_O
    w_ext_O = problem.w_ext_O - gravity.wrench_O
    w_ext_O = w_ext_O + np.concatenate([pull + f, np.cross(center, pull) + moment])
    contacts = tuple(
        c
        if c.model is ContactModel.FRICTIONLESS
        else replace(c, mu=c.mu * rng.uniform(1.0 - uncertainty.friction, 1.2))
        for c in problem.contacts
    )
    return replace(problem, contacts=contacts, w_ext_O=w_ext_O)
