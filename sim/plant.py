"""The plant: MuJoCo's truth about robot, object and contacts, behind dm_control's Physics."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np

from sim.scenario import Scenario
from sim.scene import compose, tip_geom, tip_site, unwanted_pairs
from synthesis.contact import Array

with warnings.catch_warnings():  # dm_control looks for a display on import; none is needed
    warnings.simplefilter("ignore")
    from dm_control import mujoco as dm_mujoco
    from dm_control.mujoco import wrapper

# A plant contact belongs to the environment contact point within this distance [m].
_SAME_POINT = 0.01


@dataclass(frozen=True, eq=False)
class Measurement:
    """What the controller gets to know at one instant.

    Attributes:
        t: Time [s].
        q: Joint angles [rad or m], (l,), in the order of the motors.
        qd: Joint speeds [rad/s or m/s], (l,).
        p_WO: Position of the object [m], (3,).
        quat_WO: Orientation of the object, (4,), wxyz.
    """

    t: float
    q: Array
    qd: Array
    p_WO: Array
    quat_WO: Array


class Plant:
    """Steps the scene and reads it by the scenario's names; the only module that steps MuJoCo.

    After :meth:`step` contact forces, tip and object poses belong to the state *before* the step,
    for which they were computed; :meth:`measure` gives the state after it.

    Attributes:
        physics: dm_control's Physics.
        joints: Names of the driven joints, in the order of the motors.
        collisions: Pairs of geoms that touched against the scenario's will, and when first [s].
    """

    def __init__(self, scenario: Scenario) -> None:
        self.physics = dm_mujoco.Physics.from_model(wrapper.MjModel(compose(scenario).compile()))
        self.physics.legacy_step = False  # else new contacts would be read with old forces
        self._model, self._data = self.physics.model.ptr, self.physics.data.ptr
        model = self._model
        joints = [int(model.actuator(i).trnid[0]) for i in range(model.nu)]
        self.joints = tuple(model.joint(j).name for j in joints)
        self._q = model.jnt_qposadr[joints].copy()
        self._qd = model.jnt_dofadr[joints].copy()
        thing = model.body(scenario.object.name)
        free = model.joint(scenario.object.name)
        self._pose = slice(int(free.qposadr[0]), int(free.qposadr[0]) + 7)
        self._object = thing.id
        self._tips = [model.site(tip_site(hand)).id for hand in scenario.hands]
        self._contact_of_pair = {
            self._pair(tip_geom(hand), hand.geom): i for i, hand in enumerate(scenario.hands)
        }
        self._supports_of_pair: dict[tuple[int, int], list[int]] = {}
        for i, support in enumerate(scenario.supports, start=len(scenario.hands)):
            pair = self._pair(support.surface, support.geom)
            self._supports_of_pair.setdefault(pair, []).append(i)
        self._points_O = np.array([c.p_OC_O for c in scenario.hands] or np.zeros((0, 3)))
        self._points_O = np.vstack(
            [self._points_O.reshape(-1, 3), *(np.array([s.p_OP_O]) for s in scenario.supports)]
        )
        self._object_geoms = {model.geom(g.name).id for g in scenario.object.geoms}
        self._unwanted = {self._pair(*pair) for pair in unwanted_pairs(scenario, model)}
        self.collisions: dict[tuple[str, str], float] = {}
        self._buffer = np.zeros(6)

    def _pair(self, first: str, second: str) -> tuple[int, int]:
        a, b = self._model.geom(first).id, self._model.geom(second).id
        return (a, b) if a < b else (b, a)

    def reset(self, q: Array) -> None:
        """Puts the robot at rest at joint angles q, (l,), and the object at its start."""
        self.collisions.clear()
        with self.physics.reset_context():
            self.place(q)

    def place(self, q: Array) -> None:
        """Sets the joint angles q, (l,), of a state that is being reset."""
        self._data.qpos[self._q] = q

    def apply(self, tau: Array) -> None:
        """Sets the motor torques [N·m or N], (l,), for the next step; the motors saturate."""
        self._data.ctrl[:] = tau

    def step(self) -> None:
        """One physics step.

        Raises:
            dm_control.rl.control.PhysicsError: The state has diverged.
        """
        self.physics.step()

    def measure(self) -> Measurement:
        """The present state."""
        data = self._data
        pose = data.qpos[self._pose]
        return Measurement(
            t=data.time,
            q=data.qpos[self._q],
            qd=data.qvel[self._qd],
            p_WO=pose[:3].copy(),
            quat_WO=pose[3:].copy(),
        )

    def tips(self, positions: Array, quaternions: Array, twists: Array) -> None:
        """Writes the hands' tip poses and world twists (linear first), (n, 3 | 4 | 6)."""
        for i, site in enumerate(self._tips):
            positions[i] = self._data.site_xpos[site]
            mujoco.mju_mat2Quat(quaternions[i], self._data.site_xmat[site])
            self._twist(mujoco.mjtObj.mjOBJ_SITE, site, twists[i])

    def object_twist(self, twist: Array) -> None:
        """Writes the world twist of the object frame, linear part first, (6,)."""
        self._twist(mujoco.mjtObj.mjOBJ_XBODY, self._object, twist)

    def _twist(self, kind: mujoco.mjtObj, index: int, twist: Array) -> None:
        mujoco.mj_objectVelocity(self._model, self._data, kind, index, self._buffer, 0)
        twist[:3], twist[3:] = self._buffer[3:], self._buffer[:3]

    def contacts(self, positions: Array, wrenches: Array) -> int:
        """Adds up the plant's contacts at each of the scenario's contacts.

        Args:
            positions: Written with the contact points in the world [m], (m, 3); where there is no
                contact it is left as it is.
            wrenches: Written with force on the object in world axes [N] and torsional moment about
                the normal into the object [N·m], (m, 4); zero where there is no contact.

        Returns:
            Number of contacts that the scenario does not want; see ``collisions``.
        """
        wrenches[:] = 0.0
        collisions = 0
        data = self._data
        geoms, points, frames = data.contact.geom, data.contact.pos, data.contact.frame
        for i, (first, second) in enumerate(geoms.tolist()):
            pair = (first, second) if first < second else (second, first)
            index = self._index(pair, points[i])
            if index is None:
                if pair in self._unwanted:
                    collisions += 1
                    names = (self._model.geom(first).name, self._model.geom(second).name)
                    self.collisions.setdefault(names, data.time)
                continue
            mujoco.mj_contactForce(self._model, data, i, self._buffer)
            # The contact frame's x axis points from the first geom to the second, and the force
            # is the one on the second.
            force = self._buffer[:3] @ frames[i].reshape(3, 3)
            wrenches[index, :3] += force if second in self._object_geoms else -force
            wrenches[index, 3] += self._buffer[3]
            positions[index] = points[i]
        return collisions

    def _index(self, pair: tuple[int, int], position: Array) -> int | None:
        """Which of the scenario's contacts a contact of a geom pair at a position is."""
        if pair in self._contact_of_pair:
            return self._contact_of_pair[pair]
        candidates = self._supports_of_pair.get(pair)
        if candidates is None:
            return None
        R_WO = self._data.xmat[self._object].reshape(3, 3)
        p_O = (position - self._data.xpos[self._object]) @ R_WO
        distances = np.linalg.norm(self._points_O[candidates] - p_O, axis=1)
        nearest = int(np.argmin(distances))
        return candidates[nearest] if distances[nearest] < _SAME_POINT else None
