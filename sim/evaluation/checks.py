"""The checks of a run: trace and contact history are compared with the tolerances."""

from __future__ import annotations

import math

import numpy as np

from fulcrum.sim.evaluation.failure import Category, Failure
from fulcrum.sim.evaluation.monitor import ContactHistory
from fulcrum.sim.evaluation.report import ContactReport, RunInfo, TiltReport
from fulcrum.sim.model import shared_places
from fulcrum.sim.motion import Schedule
from fulcrum.sim.scenario import Judged, Scenario
from fulcrum.sim.signals import Event, Reaction, Trace, stretches
from fulcrum.synthesis.arrays import Array, Mask, N

# Reactions that give up the manoeuvre.
_GIVEN_UP = {Reaction.LOWER: "broken off and the object lowered", Reaction.STOP: "stopped"}


def rms(values: Array) -> float:
    """Return the root mean square; 0 if there are no values."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


class Checks:
    """The checks of a run; they are the same for all runs, only the tolerances differ."""

    def __init__(
        self,
        scenario: Scenario,
        joints: tuple[str, ...],
        tolerances: Judged,
        coupled: tuple[tuple[int, ...], ...] = (),
    ) -> None:
        self._scenario, self._joints, self._limits = scenario, joints, tolerances
        self._coupled = coupled
        self._schedule = Schedule(scenario)
        self._shared = shared_places(scenario)

    def failures(
        self,
        info: RunInfo,
        trace: Trace,
        history: ContactHistory,
        tilt: TiltReport,
        contacts: dict[str, ContactReport],
    ) -> tuple[Failure, ...]:
        """Return every tolerance that was not kept, in order of time; the first is the cause."""
        phase = trace.phase.astype(int)
        held, free = self._schedule.held[phase], self._schedule.free[phase]
        found = []
        for i, contact in enumerate(contacts.values()):
            found += self._contact(i, contact, trace, history, held)
        for place in self._shared:
            found += self._place(place, trace, history, held)
        for hands in self._coupled:
            found += self._together(hands, trace, history, held)
        found += self._hands(trace, history, free)
        found += self._tracking(tilt, trace)
        found += self._torques(trace)
        if self._limits.collisions:
            found += [_collision(*names, t) for names, t in info.collisions.items()]
        if self._limits.no_forces:
            found += _no_forces(trace)
        if self._limits.given_up:
            found += [_gave_up(event) for event in info.events if event.reaction in _GIVEN_UP]
        # An error explains why the tilt was not reached; so it comes before the tilt.
        if info.error is not None:
            found.append(Failure(float(trace.t[-1]), Category.ERROR, "", info.error))
        found += self._end(tilt, trace)
        return tuple(sorted(found, key=lambda failure: failure.t))

    def lost(self, i: int, history: ContactHistory, held: Mask) -> Mask:
        """Return which steps count as lost contact while the contact should hold, (k,)."""
        limits, hand = self._limits, i < len(self._scenario.hands)
        lost_s = limits.lost_s if hand else _given(limits.support_lost_s, limits.lost_s)
        return self._stretches(held & ~history.kept[:, i], lost_s)

    def _contact(
        self,
        i: int,
        contact: ContactReport,
        trace: Trace,
        history: ContactHistory,
        held_rows: Mask,
    ) -> list[Failure]:
        limits, failures = self._limits, []
        name, hand = self._scenario.contact_names[i], i < len(self._scenario.hands)
        lost = self.lost(i, history, held_rows)
        # After its loss a contact is not judged any more.
        held = held_rows & ~np.logical_or.accumulate(lost)
        if lost.any():
            off = np.count_nonzero(held_rows & ~history.kept[:, i])
            count = f"{off} of {np.count_nonzero(held_rows)}"
            text = f"Contact {name} let go at {{when}}; it was lost in {count} steps."
            failures.append(_failure(trace, lost, Category.LOST, name, text))
        # Negated so that NaN fails, too.
        slip_mm = limits.slip_mm if hand else _given(limits.support_slip_mm, limits.slip_mm)
        slip = held & ~(1e3 * history.slip[:, i] <= slip_mm)
        slide_mm = _given(limits.slide_mm, limits.slip_mm)
        slide = held & (1e3 * history.slide[:, i] > slide_mm)
        if slip.any():
            most = 1e3 * history.slip[held, i].max()
            text = (
                f"Contact {name} slipped more than the allowed {slip_mm:g} mm at {{when}}; "
                f"{most:.3g} mm in all."
            )
            failures.append(_failure(trace, slip, Category.SLIP, name, text))
        elif slide.any():
            text = (
                f"Contact {name} slid more than the allowed {slide_mm:g} mm at {{when}}; "
                f"{contact.slide_mm:.3g} mm in all."
            )
            failures.append(_failure(trace, slide, Category.SLIDE, name, text))
        spin = held & (np.degrees(np.abs(history.spin[:, i])) > limits.spin_deg)
        if spin.any():
            text = f"Contact {name} spun more than the allowed {limits.spin_deg:g} deg at {{when}}."
            failures.append(_failure(trace, spin, Category.SPIN, name, text))
        if any(i in place for place in self._shared):
            return failures  # the other checks are made for the place as a whole
        used = held & (history.utilisation[:, i] > limits.utilisation)
        if used.any() and not any(i in hands for hands in self._coupled):
            text = (
                f"Contact {name} used {100 * contact.max_utilisation:.0f} % of its friction "
                f"(allowed {100 * limits.utilisation:.0f} %), first at {{when}}."
            )
            failures.append(_failure(trace, used, Category.FRICTION, name, text))
        peak = float(np.abs(trace.w_commanded_C[:, i, N]).max())
        share = limits.force_error if hand else limits.support_force_error
        allowed = share * peak
        if peak > 0.0 and not lost.any() and contact.force_error_rms_n > allowed:
            text = (
                f"Contact {name} followed its commanded normal force only to "
                f"{contact.force_error_rms_n:.3g} N RMS (allowed {allowed:.3g} N)."
            )
            failures.append(_failure(trace, _last(held_rows), Category.FORCE, name, text))
        return failures

    def _place(
        self, place: tuple[int, ...], trace: Trace, history: ContactHistory, held: Mask
    ) -> list[Failure]:
        """Check the total force of supports that hold the same point.

        How they share it is indeterminate, and so is the utilisation of the friction of each.
        Whether a support sticks is judged by its slip.
        """
        here = np.ix_(held, np.array(place))
        if not held.any() or not history.kept[here].all():
            return []
        measured, commanded = (
            np.einsum("kmij,kmj->ki", history.R_WC[here], wrenches[here][..., :3])
            for wrenches in (history.w_measured_C, trace.w_commanded_C)
        )
        off = rms(np.linalg.norm(measured - commanded, axis=1))
        peak = float(np.linalg.norm(commanded, axis=1).max())
        allowed = self._limits.support_force_error * peak
        if off <= allowed or math.isinf(allowed):
            return []
        names = " and ".join(self._scenario.contact_names[i] for i in place)
        text = (
            f"Contacts {names} together followed their commanded force only to {off:.3g} N RMS "
            f"(allowed {allowed:.3g} N)."
        )
        return [_failure(trace, _last(held), Category.FORCE, names, text)]

    def _together(
        self, hands: tuple[int, ...], trace: Trace, history: ContactHistory, held: Mask
    ) -> list[Failure]:
        """Check the friction used by several hands whose shares of a load are indeterminate."""
        chosen = np.array(hands)
        mu = np.array([self._scenario.hands[i].friction.mu for i in hands])
        can = mu * np.maximum(history.w_measured_C[:, chosen, N], 0.0)
        does = np.where(can > 0.0, can * history.utilisation[:, chosen], 0.0)
        share = does.sum(axis=1) / np.maximum(can.sum(axis=1), np.finfo(float).tiny)
        used = held & history.kept[:, chosen].all(axis=1) & (share > self._limits.utilisation)
        if not used.any():
            return []
        names = " and ".join(self._scenario.contact_names[i] for i in hands)
        text = (
            f"Contacts {names} together used {100 * share[used].max():.0f} % of their friction "
            f"(allowed {100 * self._limits.utilisation:.0f} %), first at {{when}}."
        )
        return [_failure(trace, used, Category.FRICTION, names, text)]

    def _hands(self, trace: Trace, history: ContactHistory, free: Mask) -> list[Failure]:
        """Check for impacts of free hands, and for hands that touch an object that stands alone."""
        failures = []
        last = self._schedule.phases[-1]
        alone = (trace.phase == len(self._schedule.phases) - 1) & (last.gap > 0.0)
        for i, hand in enumerate(self._scenario.hands):
            normal = history.w_measured_C[:, i, N]
            peak = float(trace.w_commanded_C[:, i, N].max())
            impact = free & (normal > self._limits.impact * peak)
            if impact.any() and peak > 0.0:
                text = (
                    f"Hand {hand.name} hit the object with {normal[free].max():.3g} N at {{when}}, "
                    f"more than its largest grip of {peak:.3g} N."
                )
                failures.append(_failure(trace, impact, Category.IMPACT, hand.name, text))
            if self._limits.collisions and (alone & (normal > 0.0)).any():
                text = (
                    f"Hand {hand.name} touched the object at {{when}}, when it should stand alone."
                )
                found = alone & (normal > 0.0)
                failures.append(_failure(trace, found, Category.TOUCH, hand.name, text))
        return failures

    def _tracking(self, tilt: TiltReport, trace: Trace) -> list[Failure]:
        limits = self._limits
        off = np.degrees(np.abs(trace.tilt - trace.tilt_ref)) > limits.error_deg
        if not off.any():
            return []
        text = (
            f"The tilt was off by more than the allowed {limits.error_deg:g} deg at {{when}}; "
            f"{tilt.max_error_deg:.3g} deg at worst."
        )
        return [_failure(trace, off, Category.TRACKING, "", text)]

    def _end(self, tilt: TiltReport, trace: Trace) -> list[Failure]:
        limits, end = self._limits, float(trace.t[-1])
        if not abs(tilt.final_deg - tilt.target_deg) <= limits.final_deg:
            text = (
                f"The tilt ended at {tilt.final_deg:z.2f} deg instead of {tilt.target_deg:g} +- "
                f"{limits.final_deg:g} deg."
            )
            return [Failure(end, Category.TILT, "", text)]
        if not tilt.final_mm <= limits.final_mm:
            text = (
                f"The object ended {tilt.final_mm:.3g} mm from its place "
                f"(allowed {limits.final_mm:g} mm)."
            )
            return [Failure(end, Category.PLACE, "", text)]
        return []

    def _torques(self, trace: Trace) -> list[Failure]:
        allowed = self._limits.saturated_s
        long = np.array([self._longer(flags, allowed) for flags in trace.saturated.T]).T
        cut = np.any(long, axis=1)
        if not cut.any():
            return []
        joint = self._joints[int(np.argmax(long[np.argmax(cut)]))]
        every = np.any(trace.saturated, axis=1)
        count = f"{np.count_nonzero(every)} of {len(cut)}"
        text = f"Torques were cut in {count} steps, first that of {joint} at {{when}}."
        return [_failure(trace, cut, Category.SATURATED, joint, text)]

    def _longer(self, flags: Mask, allowed_s: float) -> Mask:
        """Return where a flag has been set without a break for longer than allowed [s], (k,)."""
        if math.isinf(allowed_s):
            return np.zeros(len(flags), bool)
        return stretches(flags) > round(allowed_s / self._scenario.physics.timestep)

    def _stretches(self, flags: Mask, allowed_s: float) -> Mask:
        """Return all steps of the stretches in which a flag is set for longer than allowed [s]."""
        if math.isinf(allowed_s):
            return np.zeros(len(flags), bool)
        length = stretches(flags) + stretches(flags[::-1])[::-1] - 1
        return flags & (length > round(allowed_s / self._scenario.physics.timestep))


def _last(mask: Mask) -> Mask:
    """Return the last row of a mask alone: what is averaged over all rows is known only then."""
    return mask & (np.arange(len(mask)) == np.flatnonzero(mask)[-1])


def _given(value: float | None, default: float) -> float:
    return default if value is None else value


def _collision(first: str, second: str, t: float) -> Failure:
    pair, text = f"{first} and {second}", f"{first} touched {second} at {t:.2f} s."
    return Failure(t, Category.COLLISION, pair, text)


def _no_forces(trace: Trace) -> list[Failure]:
    failed = trace.failed > 0.0
    if not failed.any():
        return []
    count = int(failed.sum())
    text = f"The synthesis found no forces {count} times, first at {{when}}."
    return [_failure(trace, failed, Category.NO_FORCES, "", text)]


def _gave_up(event: Event) -> Failure:
    did = _GIVEN_UP[event.reaction]
    text = f"The run was {did} at {event.t:.2f} s: {event.text}."
    return Failure(event.t, Category.GIVEN_UP, event.cause, text)


def _failure(trace: Trace, mask: Mask, category: Category, subject: str, text: str) -> Failure:
    """Return a failure at the first row of a mask; ``{when}`` in its text becomes time and tilt."""
    first = int(np.argmax(mask))
    when = f"{trace.t[first]:.2f} s (tilt {abs(np.degrees(trace.tilt[first])):.1f} deg)"
    return Failure(float(trace.t[first]), category, subject, text.replace("{when}", when))
