"""What is wrong with a run, from what the controller sees and does: the findings of the guard."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fulcrum.sim.geometry import quaternion
from fulcrum.sim.model import RobotModel, RobotState
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.scenario import Guard, Scenario
from fulcrum.sim.signals import Cause, Finding, Measurement, Target
from fulcrum.synthesis.arrays import Array, Mask

# No joint turns or moves that far, or that fast, unless its encoder is broken [rad, m, or per s].
_PLAUSIBLE = 1e3
# A sensor that repeats its value to the last bit while its reference moves as far is frozen.
_FROZEN_JOINT = 0.001  # [rad or m]
_FROZEN_TILT = math.radians(0.3)
# Pose noise of half a degree per sample is no tilt error: time constant of its filter [s].
_FILTER_S = 0.05
# How long what is no matter of single samples must last [s].
_LASTING_S = 0.02


class Sent(NamedTuple):
    """What the drives asked of the motors.

    Attributes:
        tau: Torques [N·m or N], (l,).
        saturated: Which of them were cut at their limit, (l,).
        pull: The part of the torques that pulls the joints to their path, (l,).
    """

    tau: Array
    saturated: Mask
    pull: Array


class Health:
    """Makes measurements usable, and tells what is wrong.

    Attributes:
        dead: Joints whose encoders give nothing usable, (l,); None if all do.
    """

    def __init__(
        self, settings: Guard, scenario: Scenario, robot: RobotModel, start: Array
    ) -> None:
        """Takes over thresholds, the belief, and the joints' start [rad or m], (l,)."""
        self._settings, self._robot = settings, robot
        self._hands = tuple(hand.name for hand in scenario.hands)
        self._path = object_path(scenario.path)
        inward = np.array([hand.normal_O for hand in scenario.hands]).reshape(-1, 3)
        places = np.array([hand.p_OC_O for hand in scenario.hands]).reshape(-1, 3)
        self._p_OT_O = places - robot.tip_radii[:, None] * inward
        self._tau_limit = np.maximum(robot.tau_max, -robot.tau_min)
        self._torque_error = settings.torque_error * self._tau_limit
        self._q, self._q_seen, self._q_moved = start, start, start
        self._pose, self._tilt_moved, self._pose_frozen = b"", 0.0, False
        self._lost: Mask | None = None
        self._tilt_error = 0.0
        self._since: dict[Cause, float] = {}
        self._checked = -math.inf
        self.dead: Mask | None = None
        self._broken: Mask | None = None

    @property
    def uncontrolled(self) -> Mask | None:
        """Joints that cannot be kept on their path, by encoder or motor, (l,); None for none."""
        if self._broken is None or self.dead is None:
            return self.dead if self._broken is None else self._broken
        return self.dead | self._broken

    def accept(self, measurement: Measurement) -> Measurement:
        """The measurement with the last usable value of every joint whose encoder gives none."""
        q, qd = measurement.q, measurement.qd
        if not q.dot(q) + qd.dot(qd) < _PLAUSIBLE**2:
            self._lost = lost = ~((np.abs(q) < _PLAUSIBLE) & (np.abs(qd) < _PLAUSIBLE))
            measurement = measurement._replace(
                q=np.where(lost, self._q, q), qd=np.where(lost, 0.0, qd)
            )
            self.dead = lost if self.dead is None else self.dead | lost
        elif self._lost is not None:
            self._lost = self.dead = None
        self._q = measurement.q
        return measurement

    def sees_object(self, measurement: Measurement) -> bool:
        """Whether the object's pose is usable."""
        return not self._pose_frozen and _tracked(measurement)

    def check(
        self,
        measurement: Measurement,
        robot: RobotState,
        target: Target,
        sent: Sent,
        held: bool,
        failing_s: float,
        silent_s: float,
    ) -> list[Finding]:
        """What is wrong now, the gravest first.

        Args:
            measurement: An accepted measurement.
            robot: The robots as of the last synthesis.
            target: The references.
            sent: What the drives last asked for.
            held: Whether the object is held with full grip.
            failing_s: For how long the synthesis has found no forces [s].
            silent_s: For how long no setpoint has arrived where some were due [s].
        """
        settings, t = self._settings, measurement.t
        found = self._encoders(measurement, target)
        found += self._motors(t, measurement.tau, sent.tau)
        found += self._object(measurement, robot, target, held)
        if failing_s > settings.no_forces_s:
            found.append(Finding(Cause.FORCES, "the synthesis finds no forces"))
        elif silent_s > settings.silence_s and failing_s == 0.0 and self.sees_object(measurement):
            text = f"no setpoint has arrived for {1e3 * silent_s:.0f} ms"
            found.append(Finding(Cause.SILENCE, text))
        found += self._joints(measurement, target, sent)
        self._checked = t
        return found

    def _joints(self, measurement: Measurement, target: Target, sent: Sent) -> list[Finding]:
        settings, t, found = self._settings, measurement.t, []
        # An arm whose weight alone is too much sags; what counts then is how far.
        cut = bool(np.count_nonzero(sent.saturated)) and target.grip > 0.0
        if self._lasts(Cause.SATURATION, t, cut) > settings.saturated_s:
            joint = self._robot.joints[int(np.argmax(sent.saturated))]
            found.append(Finding(Cause.SATURATION, f"the torque of {joint} is cut at its limit"))
        off = np.abs(target.q - measurement.q)
        worst = int(off.argmax())
        if off[worst] > settings.joint_error:
            # A light wrist is not pulled hard, and off by much before it matters.
            hard = np.abs(sent.pull) > settings.joint_pull * self._tau_limit
            off = np.where(hard, off, 0.0)
            worst = int(off.argmax())
        if self._lasts(Cause.JOINT, t, off[worst] > settings.joint_error) > _LASTING_S:
            text = f"joint {self._robot.joints[worst]} is {off[worst]:.2g} rad or m off its path"
            found.append(Finding(Cause.JOINT, text))
        return found

    def _lasts(self, cause: Cause, t: float, present: bool) -> float:
        """For how long a symptom has been there [s]; 0 where it is not."""
        if not present:
            self._since.pop(cause, None)
            return 0.0
        return t - self._since.setdefault(cause, t)

    def _encoders(self, measurement: Measurement, target: Target) -> list[Finding]:
        same = measurement.q == self._q_seen
        self._q_seen = measurement.q
        if not np.count_nonzero(same):  # an eighth of the time that any() takes
            self._q_moved = target.q
            if self._lost is None:
                self.dead = None
                return []
            frozen = same
        else:
            self._q_moved = np.where(same, self._q_moved, target.q)
            frozen = same & (np.abs(target.q - self._q_moved) > _FROZEN_JOINT)
        lost = np.zeros_like(frozen) if self._lost is None else self._lost
        dead = frozen | lost
        self.dead = dead if dead.any() else None
        if self.dead is None:
            return []
        joint = int(np.argmax(dead))
        what = "gives no usable number" if lost[joint] else "is frozen"
        return [Finding(Cause.ENCODER, f"the encoder of {self._robot.joints[joint]} {what}")]

    def _motors(self, t: float, made: Array, asked: Array) -> list[Finding]:
        wrong = np.abs(made - asked) > self._torque_error
        if self._lasts(Cause.MOTOR, t, bool(np.count_nonzero(wrong))) <= _LASTING_S:
            return []
        self._broken = wrong
        joint = int(np.argmax(wrong))
        text = (
            f"the motor of {self._robot.joints[joint]} makes {made[joint]:.3g} "
            f"instead of {asked[joint]:.3g} N·m or N"
        )
        return [Finding(Cause.MOTOR, text)]

    def _object(
        self, measurement: Measurement, robot: RobotState, target: Target, held: bool
    ) -> list[Finding]:
        """Whether the object is seen, is where the hands are, and has the tilt it should have."""
        t, settings = measurement.t, self._settings
        pose = measurement.p_WO.tobytes() + measurement.quat_WO.tobytes()
        tracked = _tracked(measurement)
        if not tracked or pose != self._pose:
            self._pose, self._tilt_moved = pose, target.tilt
        self._pose_frozen = abs(target.tilt - self._tilt_moved) > _FROZEN_TILT
        seen = tracked and not self._pose_frozen
        blind_s = self._lasts(Cause.POSE, t, not seen)
        if not seen:
            if blind_s <= settings.blind_s:
                return []
            what = "is frozen" if tracked else "gives no usable number"
            return [Finding(Cause.POSE, f"the tracking of the object {what}")]
        tilt = float(self._path.tilt(measurement.quat_WO))
        error = math.remainder(tilt - target.tilt, 2.0 * math.pi)
        share = min(1.0, max(0.0, (t - self._checked) / _FILTER_S))
        self._tilt_error += share * (error - self._tilt_error)
        if not held:
            return []
        off = self._off_hands(measurement, robot)
        worst = int(off.argmax())
        found = []
        if self._lasts(Cause.OBJECT, t, off[worst] > settings.contact_error) > _LASTING_S:
            text = f"the object is {1e3 * off[worst]:.0f} mm off {self._hands[worst]}"
            found.append(Finding(Cause.OBJECT, text))
        error_deg = math.degrees(abs(self._tilt_error))
        if error_deg > settings.tilt_error_deg:
            found.append(Finding(Cause.TILT, f"the tilt is {error_deg:.1f} deg off"))
        return found

    def _off_hands(self, measurement: Measurement, robot: RobotState) -> Array:
        """Distances of the tips from where the object as seen would have them [m], (n,)."""
        R_WO = quaternion.matrix(measurement.quat_WO)
        off = self._p_OT_O.dot(R_WO.T) + measurement.p_WO - robot.tips()
        return np.sqrt(np.einsum("ni,ni->n", off, off))


def _tracked(measurement: Measurement) -> bool:
    """Whether the tracking of the object gives numbers that can be a pose."""
    p_WO, quat_WO = measurement.p_WO, measurement.quat_WO
    return bool(p_WO.dot(p_WO) < _PLAUSIBLE**2 and 0.0 < quat_WO.dot(quat_WO) < _PLAUSIBLE**2)
