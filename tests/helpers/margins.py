"""Friction-margin problems with unlimited squeezes: random ones, and a block on a slope."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import cvxpy as cp
import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.synthesis import Contact, ContactModel, Objective, Problem, Role
from fulcrum.synthesis.arrays import Array
from fulcrum.synthesis.errors import SolverError
from fulcrum.synthesis.reference import ReferenceInfeasibleError, _Formulation
from tests.helpers.problems import random_feasible


def squeezable(seed: int) -> Problem:
    """A random problem whose contacts, most of them, may press without limit."""
    rng = np.random.default_rng([seed, 2])
    problem = random_feasible(seed, Objective.FRICTION_MARGIN)
    unlimited = rng.random(len(problem.contacts)) < rng.choice([0.3, 0.7, 1.0])
    contacts = tuple(
        replace(c, f_n_max=np.inf if free else c.f_n_max)
        for c, free in zip(problem.contacts, unlimited, strict=True)
    )
    joints = problem.joints if rng.random() < 0.5 else None
    return replace(problem, contacts=contacts, joints=joints)


def slope(lean_deg: float = 50.0, slope_deg: float = 10.0) -> Problem:
    """A block of 20 N on three points of a slope, and a hand that may press without limit.

    Args:
        lean_deg: Angle of the hand's normal with the slope's [deg].
        slope_deg: Angle of the slope [deg].
    """
    place = Contact("place", Role.ENVIRONMENT, ContactModel.PCWF, mu=1.0)
    points = tuple(replace(place, name=f"point {k}") for k in range(3))
    turns = Rotation.from_euler("y", [[lean_deg + 180.0], [0.0], [0.0], [0.0]], degrees=True)
    R_OC: Array = turns.as_matrix()
    angle = np.radians(slope_deg)
    return Problem(
        contacts=(replace(place, name="hand", role=Role.HAND), *points),
        R_OC=R_OC,
        p_OC_O=np.array(
            [[0.0, 0.0, 0.05], [0.1, 0.1, -0.05], [0.1, -0.1, -0.05], [-0.1, 0.0, -0.05]]
        ),
        w_ext_O=20.0 * np.array([np.sin(angle), 0.0, -np.cos(angle), 0.0, 0.0, 0.0]),
        objective=Objective.FRICTION_MARGIN,
    )


def palms(angle: float) -> Problem:
    """A box of 20 N between two palms that may press without limit, with nothing under it.

    Args:
        angle: By which each normal leans down [rad].
    """
    palm = Contact("left", Role.HAND, ContactModel.PCWF, mu=0.5)
    turns = Rotation.from_euler("y", [[np.pi / 2.0 + angle], [-np.pi / 2.0 - angle]])
    R_OC: Array = turns.as_matrix()
    return Problem(
        contacts=(palm, replace(palm, name="right")),
        R_OC=R_OC,
        p_OC_O=np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]),
        w_ext_O=20.0 * np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]),
        objective=Objective.FRICTION_MARGIN,
    )


def least_utilisation(problem: Problem) -> float:
    """The margin by bisection in CVXPY, told by the smallest largest normal force.

    The reference's own phase 1 has no sign where a contact has to be unloaded.
    """
    formulation, s = _Formulation(problem), cp.Parameter(nonneg=True)
    size, largest = max(1.0, float(np.abs(problem.w_ext_O).max())), cp.Variable()
    constraints = [formulation._imbalance() / size == 0, *formulation._limits()]
    constraints += formulation._friction_cones(s)
    constraints += [f_n <= largest for f_n in formulation._normals()]
    program = cp.Problem(cp.Minimize(largest / size), constraints)

    def served(value: float) -> bool:
        s.value = value
        try:
            return formulation.run(program) < 1e4
        except (ReferenceInfeasibleError, SolverError):
            return False

    if served(1e-10):
        return 0.0
    low, high = 0.0, 1.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if served(middle) else (middle, high)
    return high


@cache
def margins() -> dict[str, float]:
    """Margins of :func:`squeezable` by seed, from :func:`least_utilisation`, which takes 0.3 s."""
    values: dict[str, float] = json.loads(Path(__file__).with_suffix(".json").read_text())
    return values
