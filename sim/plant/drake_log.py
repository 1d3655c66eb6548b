"""Motion and contacts of Drake's plant: logged at each step, assigned for many steps at once."""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context
from scipy.spatial.transform import Rotation

from fulcrum.sim.model import ContactFrames, rotations
from fulcrum.sim.plant.drake_contacts import Contacts
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace
from fulcrum.synthesis.arrays import Array, N


class DrakeLog:
    """Log of the motion of hands and object before each step, and of the contacts during it.

    Attributes:
        collisions: Time of the first contact [s] of each unwanted pair of geoms.
    """

    def __init__(self, scenario: Scenario, plant: MultibodyPlant, contacts: Contacts) -> None:
        self.collisions: dict[tuple[str, str], float] = {}
        self._plant, self._contacts = plant, contacts
        self._object = plant.GetBodyByName(scenario.object.name)
        self._frames = ContactFrames(scenario)
        tips = [tip.X_BG for tip in contacts.tips]
        self._p_BE = np.array([tip.translation() for tip in tips]).reshape(-1, 3)
        self._R_BE = np.array([tip.rotation().matrix() for tip in tips]).reshape(-1, 3, 3)
        self._count = len(scenario.contact_names)
        self._dt = scenario.physics.timestep
        self.clear()

    def clear(self) -> None:
        """Forget all steps."""
        self.collisions.clear()
        self._forget()

    def _forget(self) -> None:
        # For each step the tips' poses and twists, and the object's twist.
        self._motion: list[Array] = []
        # For each contact the step, the scenario's index, the force on the object and the place.
        self._rows: list[tuple[int, int, Array, Array]] = []
        self._collisions: list[int] = []

    def before(self, context: Context) -> None:
        """Log the motion of hands and object in the state before a step."""
        plant, row = self._plant, []
        for tip in self._contacts.tips:
            V_WB = tip.body.EvalSpatialVelocityInWorld(context)
            row += [plant.EvalBodyPoseInWorld(context, tip.body).GetAsMatrix34().ravel()]
            row += [V_WB.translational(), V_WB.rotational()]
        V_WO = self._object.EvalSpatialVelocityInWorld(context)
        row += [V_WO.translational(), V_WO.rotational()]
        self._motion.append(np.concatenate(row))

    def after(self, context: Context) -> None:
        """Log the contacts of the step that was just made."""
        results = self._plant.get_contact_results_output_port().Eval(context)
        wanted, ours = self._contacts.wanted, self._contacts.object_ids
        step = len(self._collisions)
        unwanted = 0
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair = info.point_pair()
            first, second = pair.id_A, pair.id_B
            contact = wanted.get(first, wanted.get(second))
            if contact is None:
                unwanted += 1
                self._collide(first, second, context.get_time() - self._dt)
            elif contact >= 0:
                # The force is the one on the body of the second geometry.
                force = info.contact_force() if second in ours else -info.contact_force()
                self._rows.append((step, contact, force, info.contact_point()))
        self._collisions.append(unwanted)

    def _collide(self, first: object, second: object, t: float) -> None:
        names = self._contacts.names
        self.collisions.setdefault((names[first], names[second]), t)

    def read(self, block: Trace) -> None:
        """Fill a block's columns from the steps logged since the last call."""
        steps, n = len(block), len(self._contacts.tips)
        motion = np.array(self._motion)
        tips = motion[:, : 18 * n].reshape(steps, n, 18)
        X_WB, V_WB = tips[..., :12].reshape(steps, n, 3, 4), tips[..., 12:]
        R_WB, turn = X_WB[..., :3], V_WB[..., 3:]
        lever = np.einsum("snij,nj->sni", R_WB, self._p_BE)
        block.p_WE[:] = X_WB[..., 3] + lever
        axes = np.einsum("snij,njk->snik", R_WB, self._R_BE).reshape(-1, 3, 3)
        flat = Rotation.from_matrix(axes).as_quat(scalar_first=True)
        block.quat_WE[:] = flat.reshape(block.quat_WE.shape)
        block.twist_WE[..., :3] = V_WB[..., :3] + np.cross(turn, lever)
        block.twist_WE[..., 3:] = turn
        block.twist_WO[:] = motion[:, 18 * n :]
        block.collisions[:] = self._collisions
        block.p_WC[:], block.f_W[:] = np.nan, 0.0
        if self._rows:
            self._sum(block)
        self._forget()

    def _sum(self, block: Trace) -> None:
        """Sum forces and moments about its centre at each of the scenario's contacts."""
        step, contact = np.array([row[:2] for row in self._rows]).T
        force, point = (np.array([row[i] for row in self._rows]) for i in (2, 3))
        normals = self._frames.in_world(rotations(block.quat_WO))[..., N]
        normal = normals[step, contact]
        f_n = np.einsum("ki,ki->k", force, normal)
        place = step * self._count + contact
        size = len(block) * self._count

        def total(values: Array) -> Array:
            """Return the sums of values, (k, 3) or (k,), by contact and step."""
            columns = values.T if values.ndim > 1 else [values]
            sums = [np.bincount(place, column, minlength=size) for column in columns]
            return np.array(sums, float).T.reshape(*block.f_W.shape[:2], -1)

        block.f_W[..., :3] = total(force)
        pressed = total(f_n) > 0.0
        with np.errstate(invalid="ignore", divide="ignore"):
            centers = total(f_n[:, None] * point) / total(f_n)
        hands = len(self._contacts.tips)
        centers[:, :hands] = block.p_WE + np.einsum(
            "snij,nj->sni", rotations(block.quat_WE), self._contacts.pads
        )
        block.p_WC[:] = np.where(pressed, centers, np.nan)
        lever = point - centers[step, contact]
        torsion = np.einsum("ki,ki->k", np.cross(lever, force), normal)
        block.f_W[..., 3] = np.where(pressed[..., 0], total(torsion)[..., 0], 0.0)
