"""The contact monitor: slip, spin and forces of the contacts, from the plant's contact data."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from fulcrum.sim.model import ContactFrames, rotations, true_contacts
from fulcrum.sim.motion import Schedule
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis.arrays import M_N, Array, Mask, N
from fulcrum.synthesis.contact import utilisation


@dataclass(frozen=True, eq=False)
class ContactHistory:
    """Per-contact quantities over k steps and m contacts (hands first).

    Attributes:
        R_WC: Contact axes in the world, (k, m, 3, 3).
        w_measured_C: Measured wrenches on the object in contact axes [N, N·m], (k, m, 6).
        kept: Whether there was a normal force, (k, m).
        slip: Tangential distance between the material points that touched when full grip was
            reached [m], (k, m); 0 while the object is not held.
        slide: Integral of the tangential speed at the contact since then [m], (k, m).
        spin: Integral of the angular velocity about the contact normal since then [rad], (k, m).
        utilisation: Share of the true friction that is used [-], (k, m).
    """

    R_WC: Array
    w_measured_C: Array
    kept: Mask
    slip: Array
    slide: Array
    spin: Array
    utilisation: Array

    @staticmethod
    def concatenate(parts: list[ContactHistory]) -> ContactHistory:
        """Return the history of consecutive blocks, at least one, as one history."""
        names = [field.name for field in fields(ContactHistory)]
        return ContactHistory(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})

    def pick(self, rows: NDArray[np.intp]) -> ContactHistory:
        """Return copies of the rows with the given indices."""
        return ContactHistory(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


class Monitor:
    """The monitor of a run's contacts; it is updated block by block.

    It marks the material points that touch when full grip is reached. Slip, slide and spin are
    measured only while the object is held with full grip.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._contacts = true_contacts(scenario)
        self._hands = len(scenario.hands)
        self._held = Schedule(scenario).held
        self._dt = scenario.physics.timestep
        self._frames = ContactFrames(scenario)
        self._marks: tuple[Array, Array, Array] | None = None
        self._slide = np.zeros(len(self._contacts))
        self._spin = np.zeros(len(self._contacts))

    def update(self, block: Trace) -> ContactHistory:
        """Return the contact quantities of the next rows of the run."""
        R_WO = rotations(block.quat_WO)
        R_WC = self._frames.in_world(R_WO)
        w_measured_C = np.zeros((len(block), len(self._contacts), 6))
        w_measured_C[..., :3] = np.einsum("kmji,kmj->kmi", R_WC, block.f_W[..., :3])
        w_measured_C[..., M_N] = block.f_W[..., 3]
        held = self._held[block.phase.astype(int)]
        normal = R_WC[..., :, N]
        slip = self._slips(block, R_WO, normal, held)
        slide, spin = self._integrals(block, normal, held)
        return ContactHistory(
            R_WC=R_WC,
            w_measured_C=w_measured_C,
            kept=w_measured_C[..., N] > 0.0,
            slip=slip,
            slide=slide,
            spin=spin,
            utilisation=utilisation(self._contacts, w_measured_C),
        )

    def _slips(self, block: Trace, R_WO: Array, normal: Array, held: Mask) -> Array:
        """Return the tangential distance of the material points of each contact [m], (k, m)."""
        slip = np.zeros(block.p_WC.shape[:2])
        if not held.any():
            return slip
        R_WE = rotations(block.quat_WE)
        if self._marks is None:
            first = int(np.argmax(held))
            p_WC = block.p_WC[first]
            p_OC_O = (p_WC - block.p_WO[first]) @ R_WO[first]
            hands = p_WC[: self._hands] - block.p_WE[first]
            p_EC_E = np.einsum("nji,nj->ni", R_WE[first], hands)
            self._marks = p_OC_O, p_EC_E, p_WC[self._hands :]
        p_OC_O, p_EC_E, p_WP = self._marks
        on_object = block.p_WO[:, None] + np.einsum("kij,mj->kmi", R_WO, p_OC_O)
        on_hands = block.p_WE + np.einsum("knij,nj->kni", R_WE, p_EC_E)
        on_supports = np.broadcast_to(p_WP, (len(block), *p_WP.shape))
        drift = on_object - np.concatenate([on_hands, on_supports], axis=1)
        slip[held] = np.linalg.norm(_tangential(drift, normal), axis=-1)[held]
        return slip

    def _integrals(self, block: Trace, normal: Array, held: Mask) -> tuple[Array, Array]:
        """Return slide [m] and spin [rad] of the object relative to the other body, (k, m) each."""
        n, linear, angular = self._hands, slice(0, 3), slice(3, 6)
        turn_O = np.broadcast_to(block.twist_WO[:, None, angular], block.p_WC.shape)
        lever_O = block.p_WC - block.p_WO[:, None]
        velocity = block.twist_WO[:, None, linear] + np.cross(turn_O, lever_O)
        turn = turn_O.copy()
        lever_E = block.p_WC[:, :n] - block.p_WE
        turn_E = block.twist_WE[..., angular]
        velocity[:, :n] -= block.twist_WE[..., linear] + np.cross(turn_E, lever_E)
        turn[:, :n] -= turn_E
        live = held[:, None] * self._dt
        speed = np.linalg.norm(_tangential(velocity, normal), axis=-1)
        slide = self._slide + np.cumsum(speed * live, axis=0)
        spin = self._spin + np.cumsum(np.sum(turn * normal, axis=-1) * live, axis=0)
        self._slide, self._spin = slide[-1], spin[-1]
        return slide, spin


def _tangential(vectors: Array, normal: Array) -> Array:
    return vectors - np.sum(vectors * normal, axis=-1, keepdims=True) * normal
