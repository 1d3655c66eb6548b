r"""A joint impedance that does not act along the squeeze, which is left to the feed-forward.

Hands that squeeze an object sink into it, and their pads deform: by f / K, a millimetre for 40 N on
soft rubber. The path ends at the undeformed contact, so that a joint impedance would oppose both
the force and the motion. Let J be the (6 n, l) Jacobian of the contacts of all n hands in contact
axes, M the mass matrix of the joints and u the unit vector along the commanded normal forces,
(6 n,). The joint motion of least kinetic energy that moves the hands along u only is

.. math:: \delta q = M^{-1} J^T \Lambda\, u, \qquad \Lambda = (J M^{-1} J^T)^{-1}

(Khatib 1987, the operational space formulation). The part of a deviation along it is given by the
projection

.. math:: P = \frac{M^{-1} J^T \Lambda\, u\, u^T J}{u^T J M^{-1} J^T \Lambda\, u}

Stiffness and damping become :math:`(I - P)^T K (I - P)`. They exert no force along the motion of
the squeeze and do not resist that motion. As they stay symmetric, the impedance still generates no
energy. The stiffness of the pads need not be known. Only the pads damp the squeeze.

Hands that share joints, as two fingers on one wrist, cannot make all 6 n components. Slight damping
makes :math:`\Lambda` the inverse on those that they can make. The denominator is then the share of
u that they can make; otherwise it is 1.
"""

from __future__ import annotations

import numpy as np

from fulcrum.sim.signals import Setpoint
from fulcrum.synthesis.arrays import Array, N

# Damping of the hands' compliance, as a share of its entries [-].
_SINGULAR = 1e-6
# Least share of the squeeze that the hands must be able to make [-].
_LEAST = 1e-3


def free_squeeze(mass_matrix: Array, setpoint: Setpoint, *gains: Array) -> tuple[Array, ...]:
    """Return the gains without their part that resists the squeeze of the setpoint.

    Args:
        mass_matrix: Mass matrix of the joints, (l, l).
        setpoint: Commanded wrenches of the hands, and their Jacobians.
        gains: Stiffness and damping, (l, l) each.
    """
    hands, joints = len(setpoint.J_C), len(mass_matrix)
    squeeze = np.zeros((hands, 6))
    squeeze[:, N] = setpoint.w_commanded_C[:hands, N]
    size = float(np.linalg.norm(squeeze))
    if size == 0.0:
        return gains
    u, J = squeeze.ravel() / size, setpoint.J_C.reshape(6 * hands, joints)
    weighted = np.linalg.solve(mass_matrix, J.T)
    compliance = J @ weighted
    compliance.flat[:: 6 * hands + 1] *= 1.0 + _SINGULAR
    motion = weighted @ np.linalg.solve(compliance, u)
    along = u @ J
    made = float(along @ motion)
    if made < _LEAST:
        return gains
    rest = np.eye(joints) - np.outer(motion / made, along)
    return tuple(rest.T @ gain @ rest for gain in gains)
