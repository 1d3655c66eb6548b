"""The contacts of MuJoCo's plant: logged at each step, assigned for many steps at once."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from fulcrum.sim.model import tip_geom
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import Array

# A plant contact belongs to the environment contact point within this distance [m].
_SAME_POINT = 0.01
# Initial capacity in contacts, and in components of constraint forces.
_ROOM = 1024
_COMPONENTS = np.arange(6)  # of a wrench


class ContactLog:
    """MuJoCo's contacts of consecutive steps, one row per contact.

    Attributes:
        count: Number of logged contacts; later rows are unused.
        geoms: Indices of the two geoms, (k, 2).
        point: Contact points in the world [m], (k, 3).
        frame: Contact axes as rows, (k, 9); the first is the normal, from the first geom to the
            second.
    """

    def __init__(self) -> None:
        self.geoms, self.point = np.zeros((_ROOM, 2), np.intp), np.zeros((_ROOM, 3))
        self.frame = np.zeros((_ROOM, 9))
        # Constraint forces of all steps; for each contact the index of its first one within the
        # step's (-1 without any), and their number.
        self._forces = np.zeros(_ROOM)
        self._address, self._dim = np.zeros((2, _ROOM), np.intp)
        # For each step: time, number of contacts, and index of its first constraint force.
        self._t: list[float] = []
        self._counts: list[int] = []
        self._begin: list[int] = []
        self.clear()

    def clear(self) -> None:
        """Forget all steps."""
        self.count = self._forces_count = 0
        for numbers in (self._t, self._counts, self._begin):
            numbers.clear()

    @property
    def step(self) -> NDArray[np.intp]:
        """Index of each contact's step, (count,)."""
        return np.repeat(np.arange(len(self._counts)), self._counts)

    @property
    def t(self) -> Array:
        """Time after each contact's step [s], (count,)."""
        return np.repeat(self._t, self._counts)

    def append(self, data: mujoco.MjData) -> None:
        """Log the contacts of the step that was just made."""
        contacts, forces = data.contact, data.efc_force
        count, begin = data.ncon, self._forces_count
        first, last, end = self.count, self.count + count, begin + len(forces)
        while last > len(self.geoms) or end > len(self._forces):
            self._grow()
        rows = slice(first, last)
        self._t.append(data.time)
        self._counts.append(count)
        self._begin.append(begin)
        self.geoms[rows], self.point[rows] = contacts.geom, contacts.pos
        self.frame[rows], self._dim[rows] = contacts.frame, contacts.dim
        self._address[rows], self._forces[begin:end] = contacts.efc_address, forces
        self.count, self._forces_count = last, end

    def wrenches(self) -> Array:
        """Return the wrenches on the second geom in contact axes, force first [N, N·m], (count, 6).

        They are those of mj_contactForce for elliptic cones, where constraint forces are contact
        forces.
        """
        address, dim = (column[: self.count, None] for column in (self._address, self._dim))
        begin = np.repeat(self._begin, self._counts)[:, None]
        forces = self._forces.take(begin + address + _COMPONENTS, mode="clip")
        return np.where((address >= 0) & (dim > _COMPONENTS), forces, 0.0)

    def _grow(self) -> None:
        for name, array in vars(self).items():
            if isinstance(array, np.ndarray):
                setattr(self, name, np.concatenate([array, np.zeros_like(array)]))


class ContactReader:
    """Assignment of MuJoCo's contacts to those of the scenario, by geoms and places.

    Attributes:
        collisions: Time of the first contact [s] of each unwanted pair of geoms.
    """

    def __init__(self, scenario: Scenario, model: mujoco.MjModel) -> None:
        self.collisions: dict[tuple[str, str], float] = {}
        self._dt = float(model.opt.timestep)
        self._geoms = [model.geom(g).name for g in range(model.ngeom)]
        self._is_object = np.isin(self._geoms, [g.name for g in scenario.object.geoms])
        self._unwanted = np.zeros((model.ngeom, model.ngeom), bool)
        # Only pairs that may touch have names.
        for i in (i for i in range(model.npair) if not model.pair(i).name):
            a, b = int(model.pair_geom1[i]), int(model.pair_geom2[i])
            self._unwanted[a, b] = self._unwanted[b, a] = True
        # Index of the hand by pair of geoms; -1 for none.
        self._hand = np.full((model.ngeom, model.ngeom), -1)
        for i, hand in enumerate(scenario.hands):
            self._set(self._hand, tip_geom(hand), hand.geom, i)
        self._hands = len(scenario.hands)
        supports: dict[tuple[str, str], list[int]] = {}
        for i, support in enumerate(scenario.supports):
            supports.setdefault((support.surface, support.geom), []).append(i)
        # Supports grouped by pair of geoms, and the index of the group by pair; -1 for none.
        self._supports = list(map(np.array, supports.values()))
        self._pair = np.full((model.ngeom, model.ngeom), -1)
        for i, pair in enumerate(supports):
            self._set(self._pair, *pair, i)
        self._points_O = np.array([support.p_OP_O for support in scenario.supports])

    def _set(self, table: NDArray, first: str, second: str, value: int) -> None:
        a, b = self._geoms.index(first), self._geoms.index(second)
        table[a, b] = table[b, a] = value

    def read(
        self, log: ContactLog, p_WO: Array, R_WO: Array, positions: Array, wrenches: Array
    ) -> NDArray[np.intp]:
        """Sum the plant's contacts of s steps at each of the scenario's m contacts.

        Args:
            log: Logged contacts of the plant; steps count from 0.
            p_WO: Positions of the object [m], (s, 3).
            R_WO: Orientations of the object, (s, 3, 3).
            positions: Output: contact points in the world [m], (s, m, 3); unchanged where there is
                no contact.
            wrenches: Output: forces on the object in world axes [N] and torsional moments about the
                normal into the object [N·m], (s, m, 4); zero where there is no contact.

        Returns:
            Number of contacts that the scenario does not want, (s,); see ``collisions``.
        """
        rows = slice(0, log.count)
        step, geoms, point = log.step, log.geoms[rows], log.point[rows]
        contact = self._contact(step, geoms, point, p_WO, R_WO)
        ours = contact >= 0
        where = step[ours], contact[ours]
        axes, wrench = log.frame[rows][ours].reshape(-1, 3, 3), log.wrenches()[ours]
        # The wrench is the one on the second geom.
        sign = np.where(self._is_object[geoms[ours, 1]], 1.0, -1.0)
        force = sign[:, None] * np.einsum("ki,kij->kj", wrench[:, :3], axes)
        # Sums over the contacts at the same place; np.add.at is ten times as slow.
        place = np.ravel_multi_index(where, wrenches.shape[:2])
        for i, component in enumerate((*force.T, wrench[:, 3])):
            sums = np.bincount(place, component, minlength=wrenches[..., i].size)
            wrenches[..., i] = sums.reshape(wrenches.shape[:2])
        positions[where] = point[ours]
        # A contact belongs to the state before its step.
        return self._count_collisions(step, geoms, log.t - self._dt, len(p_WO))

    def _contact(
        self, step: NDArray, geoms: NDArray, point: Array, p_WO: Array, R_WO: Array
    ) -> NDArray[np.intp]:
        """Return for each of the plant's contacts the index of the scenario's contact, or -1."""
        contact = self._hand[geoms[:, 0], geoms[:, 1]]
        pair = self._pair[geoms[:, 0], geoms[:, 1]]
        for i, supports in enumerate(self._supports):
            here = np.flatnonzero(pair == i)
            p_OC_W = point[here] - p_WO[step[here]]
            p_OC_O = np.einsum("ki,kij->kj", p_OC_W, R_WO[step[here]])
            distances = np.linalg.norm(self._points_O[supports] - p_OC_O[:, None], axis=2)
            nearest = np.argmin(distances, axis=1)
            near = distances.min(axis=1) < _SAME_POINT
            contact[here[near]] = self._hands + supports[nearest[near]]
        return contact

    def _count_collisions(
        self, step: NDArray, geoms: NDArray, t: Array, steps: int
    ) -> NDArray[np.intp]:
        unwanted = self._unwanted[geoms[:, 0], geoms[:, 1]]
        for (first, second), when in zip(geoms[unwanted].tolist(), t[unwanted], strict=True):
            self.collisions.setdefault((self._geoms[first], self._geoms[second]), float(when))
        return np.bincount(step[unwanted], minlength=steps)
