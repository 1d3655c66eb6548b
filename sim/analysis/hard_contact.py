r"""The contact forces of a logged state under hard Coulomb friction, by Pinocchio's own solver.

State, torques and torsional moments give the accelerations without contact forces. (The moments are
inputs, as Pinocchio's contacts have none.) The forces f, in the axes of each contact and its
friction cone K, are those at which no contact accelerates into the other body or slips inside its
cone:

.. math:: K \ni f \perp G f + g \in K^*, \qquad
    G = J M^{-1} J^T, \quad g = J \dot v_{free} + \dot J v

(with De Saxce's correction of g). There is neither stiffness nor regularisation in it. Where
columns of G depend on each other, as along the line between two supports of a rigid object, the
forces are not determined; those components are marked. The forces are valid only for contacts that
neither slide nor bounce.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fulcrum.sim.evaluation import ContactHistory
from fulcrum.sim.geometry import GRAVITY
from fulcrum.sim.model import ContactFrames, RobotModel, rotations
from fulcrum.sim.motion import Schedule
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis.arrays import M_N, Array, Mask, N

# Step of the finite difference of a Jacobian along the motion [s].
_H = 1e-5
# Eigenvalues of G below this share of the largest count as zero: such forces move nothing [-].
_RANK = 1e-9
_TOLERANCE = 1e-7
_EVERY_S = 0.1
_ITERATIONS = 10_000


@dataclass(frozen=True, eq=False)
class HardForces:
    """The contact forces of k rows and m contacts.

    Attributes:
        f_C: Forces on the object in contact axes [N], (k, m, 3); NaN where none was found.
        determined: Whether state and torques determine the component, (k, m, 3).
    """

    f_C: Array
    determined: Mask


@dataclass(frozen=True)
class StaticDifference:
    """The difference of one contact's hard forces from the plant's, where they are determined.

    Attributes:
        normal_rms_n: RMS of the difference of the normal forces [N].
        tangential_rms_n: RMS of the length of the difference of the tangential forces [N].
        peak_n: Largest normal force of the plant [N].
        determined: Share of the force components that are determined [-].
        solved: Share of the rows with a solution [-].
    """

    normal_rms_n: float
    tangential_rms_n: float
    peak_n: float
    determined: float
    solved: float


def static_differences(
    scenario: Scenario, trace: Trace, history: ContactHistory
) -> dict[str, StaticDifference]:
    """Compare hard contact forces with the plant's, ten times per second of full grip.

    Args:
        scenario: True scenario, as the plant has it.
        trace: Trace of a run in which the robot does not deviate from its model.
        history: Contact forces of the plant.

    Returns:
        Difference by name of the contact.
    """
    stride = max(1, round(_EVERY_S / scenario.physics.timestep))
    held = Schedule(scenario).held[trace.phase.astype(int)]
    rows = np.flatnonzero(held)[::stride]
    hard = HardContacts(scenario).forces(trace, rows)
    plant = history.w_measured_C[rows][..., :3]
    solved: Mask = np.all(np.isfinite(hard.f_C), axis=-1)
    counts = hard.determined & solved[..., None]
    off = np.where(counts, hard.f_C - plant, 0.0)
    found = {}
    for i, name in enumerate(scenario.contact_names):
        sums, n = np.sum(off[:, i] ** 2, axis=0), np.maximum(counts[:, i].sum(axis=0), 1)
        mean = sums / n
        found[name] = StaticDifference(
            normal_rms_n=float(np.sqrt(mean[N])),
            tangential_rms_n=float(np.sqrt(mean[:N].sum())),
            peak_n=float(plant[:, i, N].max(initial=0.0)),
            determined=float(hard.determined[:, i].mean()),
            solved=float(solved[:, i].mean()),
        )
    return found


class HardContacts:
    """A solver for the contact forces of a scenario's logged states."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario, self._robot = scenario, RobotModel(scenario)
        self._frames, self._hands = ContactFrames(scenario), len(scenario.hands)
        self._mu = [hand.friction.mu for hand in scenario.hands]
        self._mu += [support.friction.mu for support in scenario.supports]
        self._solver = pin.ADMMConstraintSolver()
        self._settings = pin.ADMMSolverSettings()
        self._settings.max_iterations = _ITERATIONS
        for kind in ("feasibility", "complementarity"):
            setattr(self._settings, f"absolute_{kind}_tol", _TOLERANCE)
            setattr(self._settings, f"relative_{kind}_tol", _TOLERANCE)

    def forces(self, trace: Trace, rows: NDArray[np.intp]) -> HardForces:
        """Return the forces of the touching contacts in some rows of a trace."""
        picked = trace.pick(rows)
        R_WO = rotations(picked.quat_WO)
        R_WC = self._frames.in_world(R_WO)
        found = np.zeros((len(rows), len(self._mu), 3))
        determined = np.zeros(found.shape, bool)
        for i in range(len(rows)):
            touched = np.einsum("mj,mj->m", picked.f_W[i, :, :3], R_WC[i, ..., N]) > 0.0
            if not touched.any():
                continue
            here = np.flatnonzero(touched)
            G, g = self._problem(picked, i, R_WO[i], R_WC[i], here)
            found[i, here] = self._solve(G, g, here).reshape(-1, 3)
            size, directions = np.linalg.eigh(G)
            free = directions[:, size < _RANK * size[-1]]
            determined[i, here] = (np.abs(free).max(axis=1, initial=0.0) < 1e-6).reshape(-1, 3)
        return HardForces(found, determined)

    def _problem(
        self, trace: Trace, i: int, R_WO: Array, R_WC: Array, here: NDArray[np.intp]
    ) -> tuple[Array, Array]:
        """Return G and g of the touching contacts, in contact axes."""
        thing, robot, hands = self._scenario.object, self._robot, self._hands
        q, qd, p_WC = trace.q[i], trace.qd[i], trace.p_WC[i]
        inertia = R_WO @ thing.inertia_O @ R_WO.T
        center = trace.p_WO[i] + R_WO @ thing.center_of_mass
        omega = trace.twist_WO[i, 3:]
        # Unknowns: accelerations of the joints, of the centre of mass, and of the rotation.
        joints = len(q)
        M = np.zeros((joints + 6, joints + 6))
        forces = np.zeros(joints + 6)
        state = robot.at(q)
        M[:joints, :joints] = state.mass_matrix()
        J_hands = state.contact_jacobians(p_WC[:hands], R_WC[:hands])
        bias_hands = self._hand_bias(q, qd, p_WC[:hands], R_WC[:hands], J_hands)
        coriolis = state.motion_torques(qd, np.zeros(joints))
        forces[:joints] = trace.tau[i] - state.tau_g - coriolis - robot.damping * qd
        M[joints : joints + 3, joints : joints + 3] = thing.mass * np.eye(3)
        M[joints + 3 :, joints + 3 :] = inertia
        forces[joints + 2] = -thing.mass * GRAVITY
        forces[joints + 3 :] = -np.cross(omega, inertia @ omega)
        rows, biases = [], []
        for contact in here.tolist():
            R_CW, lever = R_WC[contact].T, p_WC[contact] - center
            J = np.zeros((3, joints + 6))
            J[:, joints : joints + 3], J[:, joints + 3 :] = R_CW, -R_CW @ pin.skew(lever)
            bias = R_CW @ np.cross(omega, np.cross(omega, lever))
            if contact < hands:
                J[:, :joints] = -J_hands[contact, :3]
                bias = bias - bias_hands[contact]
                # The torsional moment is known; it acts on hand and object.
                forces[joints + 3 :] += trace.f_W[i, contact, 3] * R_CW[N]
                forces[:joints] -= trace.f_W[i, contact, 3] * J_hands[contact, M_N]
            rows.append(J)
            biases.append(bias)
        J_C = np.concatenate(rows)
        M_inv_J = np.linalg.solve(M, J_C.T)
        return J_C @ M_inv_J, M_inv_J.T @ forces + np.concatenate(biases)

    def _hand_bias(self, q: Array, qd: Array, p_WC: Array, R_WC: Array, J_C: Array) -> Array:
        """Return the hands' accelerations at constant joint speeds, in contact axes, (n, 3)."""
        moved = np.einsum("nij,njl,l->ni", R_WC, J_C[:, :3], qd)
        ends = []
        for h in (_H, -_H):
            state = self._robot.at(q + h * qd)
            ends.append(state.contact_jacobians(p_WC + h * moved, R_WC)[:, :3] @ qd)
        return (ends[0] - ends[1]) / (2.0 * _H)

    def _solve(self, G: Array, g: Array, here: NDArray[np.intp]) -> Array:
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for contact in here.tolist():
            model = pin.PointContactConstraintModel(_NOTHING, 0)
            model.setFriction(self._mu[contact])
            models.append(pin.ConstraintModel(model))
            datas.append(pin.ConstraintData(model.createData()))
        result = pin.ADMMSolverResult()
        delassus = pin.DelassusOperatorDense(G)
        self._solver.solve(delassus, g, models, datas, self._settings, result)
        if not result.converged:
            return np.full(len(g), np.nan)
        return np.array(result.retrieveConstraintImpulses())


# Pinocchio's constraints belong to a model; these only carry friction.
_NOTHING = pin.Model()
