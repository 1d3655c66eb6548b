"""Path problems whose answers are known: a carriage on a rail, from rest to rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fulcrum.synthesis import Contact, ContactModel, Joints, Problem, Role
from fulcrum.synthesis.path.limits import Rates
from fulcrum.synthesis.path.problem import InertialTorques, Load, PathObjective, PathProblem
from tests.helpers.problems import axes

MASS, FORCE, LENGTH = 2.0, 3.0, 1.5


def carriage(
    points=101,
    *,
    mass=MASS,
    robot=0.0,
    damping=0.0,
    speed=math.inf,
    objective=PathObjective.LEAST_TIME,
    **fields,
):
    """A mass between two smooth fingers on one slide, which moves it by LENGTH without friction.

    The slide pushes with at most FORCE and has a mass and viscous friction of its own.
    """
    ex, _, ez = np.eye(3)
    finger = {"role": Role.HAND, "model": ContactModel.FRICTIONLESS, "f_n_max": 100.0}
    J_C = np.zeros((2, 6, 1))
    J_C[:, 2, 0] = 1.0, -1.0
    limit = np.array([FORCE])
    problem = Problem(
        contacts=(Contact("pusher", **finger), Contact("puller", **finger)),
        R_OC=np.array([axes(ex, ez), axes(-ex, ez)]),
        p_OC_O=np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]),
        w_ext_O=np.zeros(6),
        joints=Joints(("slide",), J_C, np.zeros(1), -limit, limit),
    )
    s = np.linspace(0.0, 1.0, points)
    ones = np.ones((points, 1))
    w_a_O = mass * LENGTH * ones * np.eye(6)[0]
    return PathProblem(
        s=s,
        loads=(Load((problem,) * points, w_a_O, np.zeros((points, 6))),),
        inertial_torques=InertialTorques(
            robot * LENGTH * ones, 0.0 * ones, damping * LENGTH * ones
        ),
        rates=Rates(("slide",), LENGTH * ones, np.array([speed])),
        objective=objective,
        **fields,
    )


def bang_bang(mass, length=LENGTH, force=FORCE):
    """Least time from rest to rest without friction [s]."""
    return 2.0 * math.sqrt(length * mass / force)


def bang_bang_damped(mass, damping, length=LENGTH, force=FORCE):
    """The same with viscous friction [s], from the closed form of both halves' motion."""
    from scipy.optimize import brentq

    rate, top = damping / mass, force / damping

    def travelled(t):
        v = top * (1.0 - math.exp(-rate * t))
        brake = math.log1p(v / top) / rate
        forth = top * t - v / rate
        return forth + (v / rate - top * brake), t + brake

    t = brentq(lambda t: travelled(t)[0] - length, 1e-3, 1e3)
    return travelled(t)[1]


def moving(path, load, point, a, b):
    """(17) of a load at a grid point in motion: what accelerates object and robot counts as load.

    a and b are the acceleration of s and its squared rate there [1/s^2].
    """
    vertex, own = path.loads[load], path.inertial_torques
    problem, joints = vertex.problems[point], vertex.problems[point].joints
    w_ext_O = problem.w_ext_O - vertex.w_a_O[point] * a - vertex.w_b_O[point] * b
    if joints is not None and own is not None:
        tau = own.tau_a[point] * a + own.tau_b[point] * b + own.tau_c[point] * math.sqrt(b)
        joints = replace(joints, tau_g=joints.tau_g + tau)
    return replace(problem, w_ext_O=w_ext_O, joints=joints)
