"""Sensors: the plant's true state with noise and faults."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.geometry import quaternion
from fulcrum.sim.signals import Measurement
from fulcrum.sim.world.faults import Fault, FaultKind, of_kinds
from fulcrum.sim.world.world import World
from fulcrum.synthesis.arrays import Array

# Bandwidth of the filter that derives speeds from angles; it scales the noise of speeds.
_SPEED_FILTER = 100.0  # [rad/s]


class Sensors:
    """Encoders and the tracking of the object."""

    def __init__(self, world: World, joints: tuple[str, ...]) -> None:
        """Store the world's noise and faults, and the names of the l measured joints."""
        self._world, self._joints = world, joints
        encoders = FaultKind.ENCODER_FROZEN, FaultKind.ENCODER_DEAD
        self._encoder_faults = of_kinds(world.faults, *encoders)
        self._pose_faults = of_kinds(world.faults, FaultKind.POSE_FROZEN, FaultKind.POSE_DEAD)
        self._frozen: dict[Fault, Array] = {}
        self._random = np.random.default_rng([world.seed, 1])
        # Noise of angles, speeds, position and orientation, if not zero: one draw for all of them.
        deviations = [
            np.full(len(joints), world.encoder_noise),
            np.full(len(joints), world.encoder_noise * _SPEED_FILTER),
            np.full(3, world.position_noise),
            np.full(3, world.orientation_noise),
        ]
        flat = np.concatenate(deviations)
        self._deviations = flat[flat > 0.0]

    def see(self, truth: Measurement) -> Measurement:
        """Return the measurement that the controller gets for a true state."""
        seen = truth
        if self._deviations.size:
            seen = self._noisy(seen)
        if self._encoder_faults:
            seen = self._with_broken_encoders(seen)
        if self._pose_faults:
            seen = self._with_broken_tracking(seen)
        return seen

    def _noisy(self, seen: Measurement) -> Measurement:
        world, joints = self._world, len(self._joints)
        _, q, qd, p_WO, quat_WO, _ = seen
        noise = self._deviations * self._random.standard_normal(len(self._deviations))
        if world.encoder_noise > 0.0:
            q, qd = q + noise[:joints], qd + noise[joints : 2 * joints]
            noise = noise[2 * joints :]
        if world.position_noise > 0.0:
            p_WO = p_WO + noise[:3]
        if world.orientation_noise > 0.0:
            quat_WO = quaternion.turned(quat_WO, noise[-3:])
        return seen._replace(q=q, qd=qd, p_WO=p_WO, quat_WO=quat_WO)

    def _with_broken_encoders(self, seen: Measurement) -> Measurement:
        states = np.array([seen.q, seen.qd])
        for fault in self._encoder_faults:
            if fault.active(seen.t):
                joint = self._joints.index(fault.joint)
                states[:, joint] = self._broken(fault, states[:, joint])
        return seen._replace(q=states[0], qd=states[1])

    def _with_broken_tracking(self, seen: Measurement) -> Measurement:
        pose = np.concatenate([seen.p_WO, seen.quat_WO])
        for fault in self._pose_faults:
            if fault.active(seen.t):
                pose = self._broken(fault, pose)
        return seen._replace(p_WO=pose[:3], quat_WO=pose[3:])

    def _broken(self, fault: Fault, values: Array) -> Array:
        """Return a broken sensor's output for these values: the value when it froze, or NaN."""
        if fault.kind in (FaultKind.ENCODER_DEAD, FaultKind.POSE_DEAD):
            return np.full_like(values, np.nan)
        return self._frozen.setdefault(fault, values.copy()).copy()
