r"""Leaves the squeeze to the feed-forward: what the joint impedance neither resists nor damps.

Hands that squeeze something sink into it, and pads into hands: at f / K, a millimetre for 40 N on
soft rubber. The path ends at the undeformed contact, so a joint impedance would oppose both the
force and the motion. With J the (6 n, l) Jacobian of all n hands' contacts in contact axes, M the
joints' inertia and u the unit vector along the commanded normal forces, (6 n,), the joint motion
that moves the hands along u, and in no other of their components, with the least kinetic energy is

.. math:: \delta q = M^{-1} J^T \Lambda\, u, \qquad \Lambda = (J M^{-1} J^T)^{-1}

(Khatib 1987, the operational space formulation), and the share of any deviation along it

.. math:: P = \frac{M^{-1} J^T \Lambda\, u\, u^T J}{u^T J M^{-1} J^T \Lambda\, u}

a projection. Stiffness and damping become :math:`(I - P)^T K (I - P)`: no force along the motion of
the squeeze, no motion of the squeeze that meets one, and, K symmetric, energy as before. It takes
no stiffness of a pad. The damping of the squeeze is the pads' own.

Hands that share joints, as two fingers on one wrist, cannot make all 6 n components; a trace of
damping makes :math:`\Lambda` the inverse on those that they can. The denominator, which is 1
otherwise, is the share of u that they can.
"""

from __future__ import annotations

import numpy as np

from fulcrum.sim.signals import Setpoint
from fulcrum.synthesis.arrays import Array, N

# Damping of the hands' compliance, as a share of its entries [-].
_SINGULAR = 1e-6
# Hands that can make less than this of the squeeze do not squeeze [-].
_LEAST = 1e-3


def free_squeeze(mass_matrix: Array, setpoint: Setpoint, *gains: Array) -> tuple[Array, ...]:
    """The gains without what resists the setpoint's squeeze.

    Args:
        mass_matrix: Of the joints, (l, l).
        setpoint: What the hands are to make, and their Jacobians.
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
