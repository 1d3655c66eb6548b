r"""The wrench that accelerates the object along its path.

Newton and Euler about the centre of mass c, with :math:`\omega` the axis times the rate of the
tilt: :math:`f = m\,\ddot c`, :math:`m_c = I \dot\omega + \omega \times I \omega`.
"""

from __future__ import annotations

import numpy as np

from fulcrum.sim.model.object_path import ObjectPath
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import Array


def inertial_wrenches(scenario: Scenario, path: ObjectPath, tilt: float) -> tuple[Array, Array]:
    r"""Return the wrenches, (6,), in the object frame per :math:`\ddot\theta, \dot\theta^2`.

    Args:
        scenario: Scenario of the object.
        path: Path of the object.
        tilt: Tilt :math:`\theta` [rad].
    """
    thing = scenario.object
    center, inertia = np.asarray(thing.center_of_mass), thing.inertia_O
    R_WO, _ = path.pose(tilt)
    slope, curvature = path.derivatives(tilt, center)
    omega, alpha = R_WO.T @ path.axis(tilt), R_WO.T @ path.axis_slope(tilt)
    f_a, f_b = thing.mass * R_WO.T @ slope, thing.mass * R_WO.T @ curvature
    m_a = inertia @ omega
    m_b = inertia @ alpha + np.cross(omega, m_a)
    return (
        np.concatenate([f_a, m_a + np.cross(center, f_a)]),
        np.concatenate([f_b, m_b + np.cross(center, f_b)]),
    )
