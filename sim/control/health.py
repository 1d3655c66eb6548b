"""Checks of a run's health by measurements and commands; their findings go to the guard."""

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

# Larger joint positions and speeds mean a broken encoder [rad or m, rad/s or m/s].
_PLAUSIBLE = 1e3
# A sensor is frozen if it repeats its value to the last bit while its reference moves this far.
_FROZEN_JOINT = 0.001  # [rad or m]
_FROZEN_TILT = math.radians(0.3)
# Time constant of the filter of the tilt error [s]; pose noise may be half a degree per sample.
_FILTER_S = 0.05
# Time that a symptom must last, so that single samples do not count [s].
_LASTING_S = 0.02


class Sent(NamedTuple):
    """The torques that the drives commanded.

    Attributes:
        tau: Commanded torques [N·m or N], (l,).
        saturated: Which of them were cut at their limit, (l,).
        pull: Torques of the impedance [N·m or N], (l,).
    """

    tau: Array
    saturated: Mask
    pull: Array


class Health:
    """The health checks of one run.

    Attributes:
        dead: Joints whose encoders give no usable values, (l,); None if there are none.
    """

    def __init__(
        self, settings: Guard, scenario: Scenario, robot: RobotModel, start: Array
    ) -> None:
        """Start the checks.

        Args:
            settings: Thresholds.
            scenario: Scenario as the controller believes it to be.
            robot: Model of the robots.
            start: Joint positions at the start [rad or m], (l,).
        """
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
        """Joints without control, as encoder or motor is broken, (l,); None if there are none."""
        if self._broken is None or self.dead is None:
            return self.dead if self._broken is None else self._broken
        return self.dead | self._broken

    def accept(self, measurement: Measurement) -> Measurement:
        """Return the measurement, with unusable joint values replaced by the last usable ones."""
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
        """Return whether the object's pose is usable."""
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
        """Return the present findings, the gravest first.

        Args:
            measurement: Measurement returned by :meth:`accept`.
            robot: State of the robots at the last synthesis.
            target: References.
            sent: Torques that the drives last commanded.
            held: Whether the object is held with full grip.
            failing_s: Time for which the synthesis has found no forces [s].
            silent_s: Time for which no setpoint has arrived although some were due [s].
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
        # Without grip an arm too heavy for its motors sags; then only the joint error is checked.
        cut = bool(np.count_nonzero(sent.saturated)) and target.grip > 0.0
        if self._lasts(Cause.SATURATION, t, cut) > settings.saturated_s:
            joint = self._robot.joints[int(np.argmax(sent.saturated))]
            found.append(Finding(Cause.SATURATION, f"the torque of {joint} is cut at its limit"))
        off = np.abs(target.q - measurement.q)
        worst = int(off.argmax())
        if off[worst] > settings.joint_error:
            # The impedance of a light wrist is weak: its error counts only at a large torque.
            hard = np.abs(sent.pull) > settings.joint_pull * self._tau_limit
            off = np.where(hard, off, 0.0)
            worst = int(off.argmax())
        if self._lasts(Cause.JOINT, t, off[worst] > settings.joint_error) > _LASTING_S:
            text = f"joint {self._robot.joints[worst]} is {off[worst]:.2g} rad or m off its path"
            found.append(Finding(Cause.JOINT, text))
        return found

    def _lasts(self, cause: Cause, t: float, present: bool) -> float:
        """Return for how long a symptom has been present [s]; 0 if it is not."""
        if not present:
            self._since.pop(cause, None)
            return 0.0
        return t - self._since.setdefault(cause, t)

    def _encoders(self, measurement: Measurement, target: Target) -> list[Finding]:
        same = measurement.q == self._q_seen
        self._q_seen = measurement.q
        if not np.count_nonzero(same):  # eight times as fast as any()
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
        """Check that the object is seen, lies between the hands, and has the commanded tilt."""
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
        """Return the distances of the tips from their places on the measured object [m], (n,)."""
        R_WO = quaternion.matrix(measurement.quat_WO)
        off = self._p_OT_O.dot(R_WO.T) + measurement.p_WO - robot.tips()
        return np.sqrt(np.einsum("ni,ni->n", off, off))


def _tracked(measurement: Measurement) -> bool:
    """Return whether the tracking of the object gives numbers that can be a pose."""
    p_WO, quat_WO = measurement.p_WO, measurement.quat_WO
    return bool(p_WO.dot(p_WO) < _PLAUSIBLE**2 and 0.0 < quat_WO.dot(quat_WO) < _PLAUSIBLE**2)
