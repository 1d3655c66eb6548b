r"""Correction of MuJoCo's contact rows by the acceleration that they leave out.

The velocity of a contact row is :math:`J v`, so its acceleration is :math:`J \dot v + \dot J v`.
MuJoCo's rows set :math:`J \dot v` to the reference of stiffness and damping (``efc_aref``), and
leave out :math:`c = \dot J v`. At a point p of the object, whose frame is at x and turns with
:math:`\omega`, it is

.. math:: c = \omega \times (\omega \times (p - x))

Without c a resting contact has an acceleration error. Along the normal it causes the force
:math:`-c\, d / ((1 - d) A)` with the impedance d (:mod:`sim.model.stiffness`), by which edges let
go in fast tilts. Across the normal, where friction stops sliding within a step, sticking contacts
creep at :math:`c \Delta t`. So c is subtracted from ``efc_aref`` of all rows of a contact, the
torsional one included.

For a hand, c follows from MuJoCo's time derivative of the Jacobian (``mj_jacDot``). The contact's
axes turn with the object; the term from this is proportional to the speed of sliding, and is left
out.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from fulcrum.sim.model import hand_body
from fulcrum.sim.scenario import Scenario

# Tensor that maps a vector to the matrix of its cross product, flattened.
_CROSS = -np.array(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
        [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
        [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
).reshape(3, 9)


class Centripetal:
    """Correction for the present contacts of the object and of the hands' bodies.

    Contacts of other bodies, which are collisions, are not corrected.
    """

    def __init__(self, scenario: Scenario, model: mujoco.MjModel) -> None:
        self._model = model
        self._hands = [int(model.body(hand_body(hand)).id) for hand in scenario.hands]
        self._bodies = [int(model.body(scenario.object.name).id), *self._hands]
        # For each geom the row of its body below: 0 fixed, then object and hands; -1 for others.
        row = np.full(model.nbody, -1)
        row[model.body_weldid == 0] = 0
        row[self._bodies] = np.arange(1, 1 + len(self._bodies))
        self._geom_row = row[model.geom_bodyid]
        # For each row: a point, its acceleration, and angular velocity and acceleration.
        self._point, self._linear, self._omega, self._angular = np.zeros(
            (4, 1 + len(self._bodies), 3)
        )
        self._jac_linear, self._jac_angular = np.zeros((2, 3, model.nv))
        # Key of the present contacts, and indices that depend on it: unchanged for many steps.
        self._key: tuple[bytes, bytes] | None = None
        self._ours, self._first, self._second, self._rows, self._parts = np.zeros((5, 0), np.intp)

    def add(self, data: mujoco.MjData) -> None:
        """Correct ``efc_aref`` between ``mj_step1`` and ``mj_step2``."""
        contact = data.contact
        key = contact.geom.tobytes(), contact.efc_address.tobytes()
        if key != self._key:
            self._key = key
            self._sort(contact)
        if not len(self._ours):
            return
        self._update(data)
        # A body's acceleration at a point p is B p + o.
        spin = self._omega.dot(_CROSS).reshape(-1, 3, 3)
        B = spin @ spin + self._angular.dot(_CROSS).reshape(-1, 3, 3)
        o = self._linear - (B @ self._point[..., None])[..., 0]
        B = B.take(self._second, axis=0) - B.take(self._first, axis=0)
        o = o.take(self._second, axis=0) - o.take(self._first, axis=0)
        axes = contact.frame.take(self._ours, axis=0).reshape(-1, 3, 3)
        point = contact.pos.take(self._ours, axis=0)
        angular = self._angular.take(self._second, axis=0)
        angular -= self._angular.take(self._first, axis=0)
        vectors = np.stack([(B @ point[..., None])[..., 0] + o, angular], axis=-1)
        # For each contact: components along its three axes, then about them.
        lacking = (axes @ vectors).transpose(0, 2, 1).reshape(-1)
        data.efc_aref[self._rows] -= lacking.take(self._parts)

    def _sort(self, contact: Any) -> None:
        """Find the contacts to correct, and their rows."""
        bodies = self._geom_row[contact.geom]
        self._ours = np.flatnonzero((bodies.min(axis=1) >= 0) & (contact.efc_address >= 0))
        self._first, self._second = bodies[self._ours].T
        count = np.arange(4)
        present = count < contact.dim[self._ours][:, None]
        self._rows = (contact.efc_address[self._ours][:, None] + count)[present]
        self._parts = (6 * np.arange(len(self._ours))[:, None] + count)[present]

    def _update(self, data: mujoco.MjData) -> None:
        """Update the bodies' accelerations at zero generalised acceleration."""
        self._point[1:] = data.xpos.take(self._bodies, axis=0)
        self._omega[1:] = data.cvel.take(self._bodies, axis=0)[:, :3]
        linear, angular, qvel = self._jac_linear, self._jac_angular, data.qvel
        for row, body in enumerate(self._hands, start=2):
            mujoco.mj_jacDot(self._model, data, linear, angular, self._point[row], body)
            linear.dot(qvel, out=self._linear[row])
            angular.dot(qvel, out=self._angular[row])
