"""What happened in Drake's plant: kept step by step, told apart for many steps at once."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from fulcrum.sim.model.contacts import ContactFrames, rotations
from fulcrum.sim.plant.drake_contacts import Contacts
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.trace import Trace
from fulcrum.synthesis.arrays import Array, N


class DrakeLog:
    """Motion of hands and object before each step, and the contacts during it.

    Attributes:
        collisions: Pairs of geoms that touched against the scenario's will, and when first [s].
    """

    def __init__(self, scenario: Scenario, plant: MultibodyPlant, contacts: Contacts) -> None:
        self.collisions: dict[tuple[str, str], float] = {}
        self._plant, self._contacts = plant, contacts
        self._object = plant.GetBodyByName(scenario.object.name)
        self._frames = ContactFrames(scenario)
        self._count = len(scenario.contact_names)
        self._dt = scenario.physics.timestep
        self.clear()

    def clear(self) -> None:
        """Forgets all steps."""
        self.collisions.clear()
        self._forget()

    def _forget(self) -> None:
        # Of each step the tips' pose and twist, and the object's twist.
        self._motion: list[list[Array]] = []
        # Of each of the scenario's contacts the step, its index, the force on the object, the place.
        self._rows: list[tuple[int, int, Array, Array]] = []
        self._collisions: list[int] = []

    def before(self, context: Context) -> None:
        """Keeps the motion of hands and object in the state before a step."""
        row = []
        for tip in self._contacts.tips:
            X_WB = self._plant.EvalBodyPoseInWorld(context, tip.body)
            V_WB = tip.body.EvalSpatialVelocityInWorld(context)
            X_WE, turn = X_WB @ tip.X_BG, V_WB.rotational()
            lever = X_WE.translation() - X_WB.translation()
            row += [X_WE.translation(), X_WE.rotation().ToQuaternion().wxyz()]
            row += [V_WB.translational() + np.cross(turn, lever), turn]
        V_WO = self._object.EvalSpatialVelocityInWorld(context)
        row += [V_WO.translational(), V_WO.rotational()]
        self._motion.append(row)

    def after(self, context: Context) -> None:
        """Keeps the contacts of the step that was just made."""
        results = self._plant.get_contact_results_output_port().Eval(context)
        touches, ours, step = self._contacts.touches, self._contacts.object_ids, len(self._collisions)
        unwanted = 0
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair = info.point_pair()
            first, second = pair.id_A, pair.id_B
            touch = touches.get(first) or touches[second]
            if touch.link:
                unwanted += 1
                self._collide(first, second, context.get_time() - self._dt)
            elif touch.contact >= 0:
                # The force is that on the body of the second.
                force = info.contact_force() if second in ours else -info.contact_force()
                self._rows.append((step, touch.contact, force, info.contact_point()))
        self._collisions.append(unwanted)

    def _collide(self, first: object, second: object, t: float) -> None:
        names = self._contacts.names
        self.collisions.setdefault((names[first], names[second]), t)

    def read(self, block: Trace) -> None:
        """Fills a block's columns from the steps that were kept since the last call."""
        steps, n = len(block), len(self._contacts.tips)
        motion = np.array([np.concatenate(row) for row in self._motion])
        tips = motion[:, : 13 * n].reshape(steps, n, 13)
        block.p_WE[:], block.quat_WE[:] = tips[..., :3], tips[..., 3:7]
        block.twist_WE[:], block.twist_WO[:] = tips[..., 7:], motion[:, 13 * n :]
        block.collisions[:] = self._collisions
        block.p_WC[:], block.f_W[:] = np.nan, 0.0
        if self._rows:
            self._sum(block)
        self._forget()

    def _sum(self, block: Trace) -> None:
        """Adds up what touches at each of the scenario's contacts, about its centre of pressure."""
        step, contact = np.array([row[:2] for row in self._rows]).T
        force, point = (np.array([row[i] for row in self._rows]) for i in (2, 3))
        normals = self._frames.in_world(rotations(block.quat_WO))[..., N]
        normal = normals[step, contact]
        f_n = np.einsum("ki,ki->k", force, normal)
        place = step * self._count + contact
        size = len(block) * self._count

        def total(values: Array) -> Array:
            """Sums by contact and step, of (k, 3) or (k,)."""
            columns = values.T if values.ndim > 1 else [values]
            sums = [np.bincount(place, column, minlength=size) for column in columns]
            return np.array(sums).T.reshape(*block.f_W.shape[:2], -1)

        block.f_W[..., :3] = total(force)
        pressed = total(f_n) > 0.0
        with np.errstate(invalid="ignore", divide="ignore"):
            centers = total(f_n[:, None] * point) / total(f_n)
        block.p_WC[:] = np.where(pressed, centers, np.nan)
        lever = point - centers[step, contact]
        torsion = np.einsum("ki,ki->k", np.cross(lever, force), normal)
        block.f_W[..., 3] = np.where(pressed[..., 0], total(torsion)[..., 0], 0.0)
