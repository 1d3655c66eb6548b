r"""Adds to MuJoCo's contact rows the acceleration that they leave out.

The velocity of a contact row is :math:`J v`, so that its acceleration is :math:`J \dot v + \dot J
v`. MuJoCo's rows ask :math:`J \dot v` to be what stiffness and damping want (``efc_aref``), and
leave out :math:`c = \dot J v`: at a point p of the object, whose frame is at x and turns with
:math:`\omega`,

.. math:: c = \omega \times (\omega \times (p - x))

Without it a resting contact takes c for acceleration of its own. Along the normal the impedance d
makes :math:`-c\, d / ((1 - d) A)` of it (:mod:`sim.model.stiffness`), by which edges let go in fast
tilts; across, where friction stops what slides within the step, what sticks creeps with :math:`c
\Delta t`. So c is taken off ``efc_aref`` of all of a contact's rows, the torsional one included.

Of a hand c follows from MuJoCo's time derivative of the Jacobian (``mj_jacDot``). The contact's
axes turn with the object; what that adds goes with the speed of sliding, and is left out.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from fulcrum.sim.model import hand_body
from fulcrum.sim.scenario import Scenario

# The cross product with a vector, as a matrix: its entries are linear in the vector's.
_CROSS = -np.array(
    [
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
        [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
        [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
).reshape(3, 9)


class Centripetal:
    """What the present contacts' rows lack, for the object and the bodies of the hands.

    Contacts of other bodies, which are collisions, are left as MuJoCo has them.
    """

    def __init__(self, scenario: Scenario, model: mujoco.MjModel) -> None:
        self._model = model
        self._hands = [int(model.body(hand_body(hand)).id) for hand in scenario.hands]
        self._bodies = [int(model.body(scenario.object.name).id), *self._hands]
        # Of each geom the row of its body below: what stands still, the object, the hands; else -1.
        row = np.full(model.nbody, -1)
        row[model.body_weldid == 0] = 0
        row[self._bodies] = np.arange(1, 1 + len(self._bodies))
        self._geom_row = row[model.geom_bodyid]
        # Of each row: a point, there the acceleration, angular velocity and acceleration.
        self._point, self._linear, self._omega, self._angular = np.zeros(
            (4, 1 + len(self._bodies), 3)
        )
        self._jac_linear, self._jac_angular = np.zeros((2, 3, model.nv))
        # Which contacts there are, and what follows from that: the same for many steps.
        self._key: tuple[bytes, bytes] | None = None
        self._ours, self._first, self._second, self._rows, self._parts = np.zeros((5, 0), np.intp)

    def add(self, data: mujoco.MjData) -> None:
        """Corrects ``efc_aref`` between ``mj_step1`` and ``mj_step2``."""
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
        # Of each contact along its three axes, then the torsion about the first.
        lacking = (axes @ vectors).transpose(0, 2, 1).reshape(-1)
        data.efc_aref[self._rows] -= lacking.take(self._parts)

    def _sort(self, contact: Any) -> None:
        """Finds the contacts of bodies that count, and their rows."""
        bodies = self._geom_row[contact.geom]
        self._ours = np.flatnonzero((bodies.min(axis=1) >= 0) & (contact.efc_address >= 0))
        self._first, self._second = bodies[self._ours].T
        count = np.arange(4)
        present = count < contact.dim[self._ours][:, None]
        self._rows = (contact.efc_address[self._ours][:, None] + count)[present]
        self._parts = (6 * np.arange(len(self._ours))[:, None] + count)[present]

    def _update(self, data: mujoco.MjData) -> None:
        """Accelerations at no acceleration of the coordinates: of the object none but turning."""
        self._point[1:] = data.xpos.take(self._bodies, axis=0)
        self._omega[1:] = data.cvel.take(self._bodies, axis=0)[:, :3]
        linear, angular, qvel = self._jac_linear, self._jac_angular, data.qvel
        for row, body in enumerate(self._hands, start=2):
            mujoco.mj_jacDot(self._model, data, linear, angular, self._point[row], body)
            linear.dot(qvel, out=self._linear[row])
            angular.dot(qvel, out=self._angular[row])
