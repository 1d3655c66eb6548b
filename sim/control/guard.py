"""The rule by which a run is held, lowered or stopped.

=====================================  ==================================  =========================
cause                                  while it lasts                      if it persists
=====================================  ==================================  =========================
no setpoint arrives                    hold, then go on                    lower
the synthesis finds no forces          hold, then go on                    lower
the object's pose is missing, frozen   hold, then go on                    lower
the tilt is not followed               hold, then go on                    lower
a joint is off its path                hold, then go on                    lower
a torque is cut at its limit           hold, then go on                    lower
an encoder gives nothing, or freezes   without impedance at that joint     stop
a motor does not make its torque                                           stop, let go
the object is not where the hands are                                      stop, let go
lowering is blocked                                                        stop
=====================================  ==================================  =========================

Hold: path time stands still; forces and impedance stay on. Lower: path time runs backwards. The
object goes down the way it came; at the bottom the hands release it and withdraw. Where no new
setpoint arrives, the drives apply the forces that held the object there on its way up. Stop: hold
until the end. Let go: the contact forces fade to zero. After the hands have released the object at
the end of a manoeuvre it cannot be lowered; the run stops instead.
A run ends one second after it was stopped, or after the hands have withdrawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fulcrum.sim.scenario import Guard
from fulcrum.sim.signals import Cause, Event, Finding, Mode, Reaction

# Time recorded after the end, to see that everything is at rest [s].
_AFTER_S = 1.0
# Time without findings before a held run goes on [s].
_SETTLED_S = 0.2
# Time for which an encoder may give no values: about ten of its samples [s].
_ENCODER_S = 0.02
# Time in which the forces fade when the hands let go [s].
_FADE_S = 0.3


RATES = {Mode.RUN: 1.0, Mode.HOLD: 0.0, Mode.LOWER: -1.0, Mode.STOP: 0.0}


STOPPING = {Cause.ENCODER: _ENCODER_S, Cause.MOTOR: 0.0, Cause.OBJECT: 0.0}
_LETTING_GO = (Cause.MOTOR, Cause.OBJECT)
_BLOCKING = (Cause.SATURATION, Cause.JOINT)


class Supervisor:
    """The guard's state machine: findings go in, the mode of the run comes out.

    Attributes:
        mode: Present mode of the run.
        events: Events so far.
        stands: Whether the arms stay at the joint angles at which they were stopped, off the path.
    """

    def __init__(self, settings: Guard) -> None:
        self._settings = settings
        self.mode = Mode.RUN
        self.events: list[Event] = []
        self.stands = False
        self._since: dict[Cause, float] = {}
        self._held_from = self._lowered_from = self._last_trouble = 0.0
        self._held_s = 0.0
        self._let_go_at = self._ends_at = math.inf

    @property
    def rate(self) -> float:
        """Seconds of path time per second in the present mode [-]."""
        return RATES[self.mode]

    def grip(self, t: float) -> float:
        """Return the share of the grip at a time [s]; 1 unless the hands let go [-]."""
        return max(0.0, min(1.0, 1.0 - (t - self._let_go_at) / _FADE_S))

    def left_s(self, t: float, path_t: float) -> float:
        """Return the time to the end of a lowered or stopped run, by time and path time [s]."""
        return self._ends_at - t if math.isfinite(self._ends_at) else path_t + _AFTER_S

    def update(self, t: float, findings: Sequence[Finding], path_t: float, lowerable: bool) -> None:
        """Set the mode by the findings at a time.

        Args:
            t: Time [s].
            findings: Present findings.
            path_t: Path time [s].
            lowerable: Whether the hands have not yet let go at the end of the manoeuvre.
        """
        if self.mode is Mode.RUN and not findings:
            return
        found = {finding.cause: finding.text for finding in findings}
        self._since = {cause: self._since.get(cause, t) for cause in found}
        if self.mode is Mode.STOP:
            return
        for cause, text in found.items():
            if t - self._since[cause] >= STOPPING.get(cause, math.inf):
                self._stop(t, cause, text)
                return
        if self.mode is Mode.RUN:
            self._hold(t, *next(iter(found.items())))
        elif self.mode is Mode.HOLD:
            self._wait(t, found, lowerable)
        else:
            self._lower(t, found, path_t)

    def _hold(self, t: float, cause: Cause, text: str) -> None:
        self._enter(Mode.HOLD, t, cause, text)
        self._held_from = self._last_trouble = t

    def _wait(self, t: float, found: dict[Cause, str], lowerable: bool) -> None:
        """Go on after a while without findings; lower if that takes too long."""
        if found:
            self._last_trouble = t
        held_s = t - self._held_from
        if t - self._last_trouble >= _SETTLED_S:
            self._held_s += held_s
            self._enter(Mode.RUN, t, self.events[-1].cause, f"it passed after {held_s:.2f} s")
        elif held_s >= self._settings.hold_s or self._held_s + held_s >= self._settings.holds_s:
            persists = next((item for item in found.items() if item[0] not in STOPPING), None)
            if persists is None:
                return
            if lowerable:
                self._enter(Mode.LOWER, t, *persists)
                self._lowered_from = t
            else:
                self._stop(t, *persists)

    def _lower(self, t: float, found: dict[Cause, str], path_t: float) -> None:
        """End at the start of the path; stop if something keeps the arms from following it."""
        for cause in _BLOCKING:
            since = max(self._since.get(cause, math.inf), self._lowered_from)
            if t - since >= self._settings.lower_s and not math.isfinite(self._ends_at):
                self._stop(t, cause, f"lowering is blocked, {found[cause]}")
                return
        if path_t <= 0.0 and not math.isfinite(self._ends_at):
            self._ends_at = t + _AFTER_S
            text = "the hands are back where they began"
            self.events.append(Event(t, self.events[-1].cause, Reaction.END, text))

    def _stop(self, t: float, cause: Cause, text: str) -> None:
        self._enter(Mode.STOP, t, cause, text)
        self._ends_at = t + _AFTER_S
        # Arms that hold the object come to rest on the path: an abrupt stop would shake it off.
        self.stands = cause is not Cause.ENCODER
        if cause in _LETTING_GO:
            self._let_go_at = t

    def _enter(self, mode: Mode, t: float, cause: Cause, text: str) -> None:
        self.mode = mode
        self.events.append(Event(t, cause, Reaction(mode.name.lower()), text))
