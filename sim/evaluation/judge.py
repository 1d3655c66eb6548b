"""The verdict: what a run must show, what it showed, and in words what went wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fulcrum.sim.evaluation.monitor import ContactHistory
from fulcrum.sim.evaluation.report import (
    ContactReport,
    PhaseReport,
    Report,
    RunInfo,
    SynthesisReport,
    TiltReport,
    TimingReport,
    TorqueReport,
    Verdict,
)
from fulcrum.sim.model.contacts import shared_places
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.event import Event
from fulcrum.sim.signals.trace import Trace, stretches, torque_shares
from fulcrum.synthesis.arrays import Array, Mask, N

# Reactions after which a manoeuvre is not completed.
_GIVEN_UP = {"lower": "broken off and the object lowered", "stop": "stopped"}


class Judge:
    """Compares a trace with the scenario's tolerances."""

    def __init__(
        self, scenario: Scenario, joints: tuple[str, ...], tau_min: Array, tau_max: Array
    ) -> None:
        self._scenario = scenario
        self._joints = joints
        self._tau_min, self._tau_max = tau_min, tau_max
        self._schedule = Schedule(scenario)
        self._shared = shared_places(scenario)

    def report(self, info: RunInfo, trace: Trace, history: ContactHistory) -> Report:
        """The report of a run of at least one step."""
        phase = trace.phase.astype(int)
        held = self._schedule.held[phase]
        free = self._schedule.free[phase]
        tilt = self._tilt(trace)
        torque = self._torque(trace)
        contacts = {
            name: _contact(i, trace, history, held, free)
            for i, name in enumerate(self._scenario.contact_names)
        }
        if info.interrupted:
            verdict = Verdict.INTERRUPTED
            failures = [f"The run was interrupted at {trace.t[-1]:.2f} s."]
        else:
            found = self._contact_failures(trace, history, held, contacts)
            for place in self._shared:
                found += self._place_failures(place, trace, history, held)
            found += self._hand_failures(trace, history, free)
            found += self._tilt_failures(tilt, trace)
            found += [_collision(*names, t) for names, t in info.collisions.items()]
            found += self._torque_failures(trace) + _synthesis_failures(trace)
            found += [_gave_up(event) for event in info.events if event.reaction in _GIVEN_UP]
            found += [] if info.error is None else [_Failure(float(trace.t[-1]), info.error)]
            # In order of time, so that the first is the cause.
            failures = [failure.text for failure in sorted(found, key=lambda f: f.t)]
            verdict = Verdict.FAIL if failures else Verdict.PASS
        sim_s = len(trace) * self._scenario.physics.timestep
        return Report(
            scenario=self._scenario.name,
            controller=info.controller,
            objective=info.objective,
            seed=info.seed,
            verdict=verdict,
            failures=tuple(failures),
            events=info.events,
            phases=self._phases(trace),
            tilt=tilt,
            contacts=contacts,
            torque=torque,
            synthesis=_synthesis(trace),
            timing=TimingReport(sim_s, info.wall_s, sim_s / info.wall_s),
            recording=info.recording,
        )

    def _phases(self, trace: Trace) -> tuple[PhaseReport, ...]:
        names = [phase.name for phase in self._schedule.phases]
        begun = np.flatnonzero(np.diff(trace.phase, prepend=-1.0))
        starts = trace.t[begun].tolist()
        return tuple(
            PhaseReport(names[int(trace.phase[row])], start, end)
            for row, start, end in zip(
                begun, starts, [*starts[1:], float(trace.t[-1])], strict=True
            )
        )

    def _tilt(self, trace: Trace) -> TiltReport:
        error = np.degrees(trace.tilt - trace.tilt_ref)
        target = self._scenario.path.angle_deg * self._schedule.phases[-1].tilt
        return TiltReport(
            target_deg=target,
            final_deg=float(np.degrees(trace.tilt[-1])),
            rms_error_deg=_rms(error),
            max_error_deg=float(np.abs(error).max()),
        )

    def _torque(self, trace: Trace) -> TorqueReport:
        share = torque_shares(trace.tau, self._tau_min, self._tau_max)
        worst = int(np.argmax(share.max(axis=0)))
        return TorqueReport(
            max_utilisation=float(share.max()),
            joint=self._joints[worst],
            saturated_fraction=float(np.mean(np.any(trace.saturated, axis=1))),
        )

    def _contact_failures(
        self,
        trace: Trace,
        history: ContactHistory,
        held_rows: Mask,
        contacts: dict[str, ContactReport],
    ) -> list[_Failure]:
        limits, failures = self._scenario.tolerances, []
        for i, (name, contact) in enumerate(contacts.items()):
            lost = held_rows & ~history.kept[:, i]
            # What a contact does once it has let go is no news.
            held = held_rows & ~np.logical_or.accumulate(lost)
            if lost.any():
                count = f"{np.count_nonzero(lost)} of {np.count_nonzero(held_rows)}"
                text = f"Contact {name} let go at {{when}}; it was lost in {count} steps."
                failures.append(_failure(trace, lost, text))
            slip = held & (1e3 * history.slip[:, i] > limits.slip_mm)
            slide = held & (1e3 * history.slide[:, i] > limits.slip_mm)
            allowed = f"more than the allowed {limits.slip_mm:g} mm"
            if slip.any():
                text = (
                    f"Contact {name} slipped {allowed} at {{when}}; "
                    f"{contact.slip_mm:.3g} mm in all."
                )
                failures.append(_failure(trace, slip, text))
            elif slide.any():
                text = (
                    f"Contact {name} slid {allowed} at {{when}}; {contact.slide_mm:.3g} mm in all."
                )
                failures.append(_failure(trace, slide, text))
            spin = held & (np.degrees(np.abs(history.spin[:, i])) > limits.spin_deg)
            if spin.any():
                allowed = f"more than the allowed {limits.spin_deg:g} deg"
                text = f"Contact {name} spun {allowed} at {{when}}."
                failures.append(_failure(trace, spin, text))
            if any(i in place for place in self._shared):
                continue  # what is left is judged for the place as a whole
            used = held & (history.utilisation[:, i] > limits.utilisation)
            if used.any():
                text = (
                    f"Contact {name} used {100 * contact.max_utilisation:.0f} % of its friction "
                    f"(allowed {100 * limits.utilisation:.0f} %), first at {{when}}."
                )
                failures.append(_failure(trace, used, text))
            peak = float(np.abs(trace.w_commanded_C[:, i, N]).max())
            hand = i < len(self._scenario.hands)
            allowed_n = peak * (limits.force_error if hand else limits.support_force_error)
            if peak > 0.0 and not lost.any() and contact.force_error_rms_n > allowed_n:
                text = (
                    f"Contact {name} followed its commanded normal force only to "
                    f"{contact.force_error_rms_n:.3g} N RMS "
                    f"(allowed {allowed_n:.3g} N)."
                )
                failures.append(_failure(trace, held_rows, text))
        return failures

    def _place_failures(
        self, place: tuple[int, ...], trace: Trace, history: ContactHistory, held: Mask
    ) -> list[_Failure]:
        """The force of supports that hold the same point; how they share it is indeterminate.

        So is how much of its friction one of them uses; whether it sticks is what slip says.
        """
        here = np.ix_(held, np.array(place))
        if not held.any() or not history.kept[here].all():
            return []
        measured, commanded = (
            np.einsum("kmij,kmj->ki", history.R_WC[here], wrenches[here][..., :3])
            for wrenches in (history.w_measured_C, trace.w_commanded_C)
        )
        off = _rms(np.linalg.norm(measured - commanded, axis=1))
        share = self._scenario.tolerances.support_force_error
        allowed = share * np.linalg.norm(commanded, axis=1).max()
        if off <= allowed:
            return []
        names = " and ".join(self._scenario.contact_names[i] for i in place)
        text = (
            f"Contacts {names} together followed their commanded force only to {off:.3g} N RMS "
            f"(allowed {allowed:.3g} N)."
        )
        return [_failure(trace, held, text)]

    def _hand_failures(self, trace: Trace, history: ContactHistory, free: Mask) -> list[_Failure]:
        """Impacts while hands come and go, and hands that touch an object that stands alone."""
        failures = []
        last = self._schedule.phases[-1]
        alone = (trace.phase == len(self._schedule.phases) - 1) & (last.gap > 0.0)
        for i, hand in enumerate(self._scenario.hands):
            normal = history.w_measured_C[:, i, N]
            peak = float(trace.w_commanded_C[:, i, N].max())
            impact = free & (normal > peak)
            if impact.any() and peak > 0.0:
                text = (
                    f"Hand {hand.name} hit the object with {normal[free].max():.3g} N at {{when}}, "
                    f"more than its largest grip of {peak:.3g} N."
                )
                failures.append(_failure(trace, impact, text))
            if (alone & (normal > 0.0)).any():
                text = (
                    f"Hand {hand.name} touched the object at {{when}}, when it should stand alone."
                )
                failures.append(_failure(trace, alone & (normal > 0.0), text))
        return failures

    def _tilt_failures(self, tilt: TiltReport, trace: Trace) -> list[_Failure]:
        limits, failures = self._scenario.tolerances, []
        off = np.degrees(np.abs(trace.tilt - trace.tilt_ref)) > limits.error_deg
        if off.any():
            text = (
                f"The tilt was off by more than the allowed {limits.error_deg:g} deg at {{when}}; "
                f"{tilt.max_error_deg:.3g} deg at worst."
            )
            failures.append(_failure(trace, off, text))
        if abs(tilt.final_deg - tilt.target_deg) > limits.final_deg:
            text = (
                f"The tilt ended at {tilt.final_deg:z.2f} deg instead of {tilt.target_deg:g} +- "
                f"{limits.final_deg:g} deg."
            )
            failures.append(_Failure(float(trace.t[-1]), text))
        return failures

    def _torque_failures(self, trace: Trace) -> list[_Failure]:
        allowed = round(self._scenario.tolerances.saturated_s / self._scenario.physics.timestep)
        long = np.array([stretches(flags) > allowed for flags in trace.saturated.T]).T
        cut = np.any(long, axis=1)
        if not cut.any():
            return []
        joint = self._joints[int(np.argmax(long[np.argmax(cut)]))]
        every = np.any(trace.saturated, axis=1)
        count = f"{np.count_nonzero(every)} of {len(cut)}"
        text = f"Torques were cut in {count} steps, first that of {joint} at {{when}}."
        return [_failure(trace, cut, text)]


@dataclass(frozen=True)
class _Failure:
    t: float
    text: str


def _collision(first: str, second: str, t: float) -> _Failure:
    return _Failure(t, f"{first} touched {second} at {t:.2f} s.")


def _gave_up(event: Event) -> _Failure:
    did = _GIVEN_UP[event.reaction]
    return _Failure(event.t, f"The run was {did} at {event.t:.2f} s: {event.cause}.")


def _failure(trace: Trace, mask: Mask, text: str) -> _Failure:
    """A failure at the first row of a mask; ``{when}`` in its text becomes time and tilt."""
    first = int(np.argmax(mask))
    when = f"{trace.t[first]:.2f} s (tilt {abs(np.degrees(trace.tilt[first])):.1f} deg)"
    return _Failure(float(trace.t[first]), text.replace("{when}", when))


def _contact(
    i: int, trace: Trace, history: ContactHistory, held_rows: Mask, free: Mask
) -> ContactReport:
    impact = float(history.w_measured_C[free, i, N].max(initial=0.0))
    if not held_rows.any():
        return ContactReport(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, impact)
    kept = history.kept[held_rows, i]
    held = np.logical_and.accumulate(kept)
    normal = history.w_measured_C[held_rows, i, N]

    def largest(quantity: Array) -> float:
        return float(quantity[held_rows, i][held].max(initial=0.0))

    return ContactReport(
        kept_fraction=float(kept.mean()),
        slip_mm=1e3 * largest(history.slip),
        slide_mm=1e3 * largest(history.slide),
        spin_deg=float(np.degrees(largest(np.abs(history.spin)))),
        max_utilisation=largest(history.utilisation),
        max_normal_n=float(normal.max()),
        force_error_rms_n=_rms(normal - trace.w_commanded_C[held_rows, i, N]),
        free_normal_n=impact,
    )


def _synthesis(trace: Trace) -> SynthesisReport:
    times = 1e6 * trace.synthesis_s[trace.synthesis_s > 0.0]
    p50, p99 = np.percentile(times, [50, 99]) if times.size else (0.0, 0.0)
    return SynthesisReport(len(times), int(trace.failed.sum()), float(p50), float(p99))


def _synthesis_failures(trace: Trace) -> list[_Failure]:
    failed = trace.failed > 0.0
    if not failed.any():
        return []
    count = int(failed.sum())
    text = f"The synthesis found no forces {count} times, first at {{when}}."
    return [_failure(trace, failed, text)]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
