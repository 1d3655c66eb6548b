"""The verdict: what a run must show, what it showed, and in words what went wrong."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from sim.monitor import ContactHistory
from sim.path import Schedule
from sim.scenario import Scenario
from sim.trace import Trace
from synthesis.contact import Array, Mask, N


class Verdict(StrEnum):
    """How a run ended."""

    PASS = "pass"
    FAIL = "fail"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class TiltReport:
    """Target, final value and errors of the tilt [deg]; errors count once grip is built up."""

    target_deg: float
    final_deg: float
    rms_error_deg: float
    max_error_deg: float


@dataclass(frozen=True)
class ContactReport:
    """What one contact did once grip was built up; utilisation until it let go."""

    kept_fraction: float
    slip_mm: float
    slide_mm: float
    spin_deg: float
    max_utilisation: float
    max_normal_n: float
    force_error_rms_n: float


@dataclass(frozen=True)
class TorqueReport:
    """Largest share of a torque limit, at which joint, and how often a torque was cut."""

    max_utilisation: float
    joint: str
    saturated_fraction: float


@dataclass(frozen=True)
class SynthesisReport:
    """Syntheses (robot quantities, assembly, solve, unpacking): how many, failed, wall time."""

    solves: int
    failures: int
    p50_us: float
    p99_us: float


@dataclass(frozen=True)
class TimingReport:
    """Simulated time, wall time of loop, monitor and recording, and their ratio."""

    sim_s: float
    wall_s: float
    real_time_factor: float


@dataclass(frozen=True)
class Report:
    """The result of a run, as ``report.json`` holds it; finite numbers only."""

    scenario: str
    controller: str
    objective: str
    seed: int
    verdict: Verdict
    failures: tuple[str, ...]
    tilt: TiltReport
    contacts: dict[str, ContactReport]
    torque: TorqueReport
    synthesis: SynthesisReport
    timing: TimingReport
    recording: str | None


@dataclass(frozen=True)
class RunInfo:
    """What a run was: the parts of the report that are no measurement of the trace.

    Attributes:
        controller: Name of the controller.
        objective: What the synthesis minimised.
        seed: Seed of the run.
        wall_s: Wall time of loop, monitor and recording [s].
        interrupted: Whether the run was stopped before its end.
        error: What ended the run, if something did.
        recording: Name of the recording's file.
    """

    controller: str
    objective: str
    seed: int
    wall_s: float
    interrupted: bool = False
    error: str | None = None
    recording: str | None = None


class Judge:
    """Compares a trace with the scenario's tolerances."""

    def __init__(
        self, scenario: Scenario, joints: tuple[str, ...], tau_min: Array, tau_max: Array
    ) -> None:
        self._scenario = scenario
        self._joints = joints
        self._tau_min, self._tau_max = tau_min, tau_max
        self._end = np.radians(scenario.path.angle_deg)
        self._settled_s = Schedule(scenario.timing, self._end).settled_s

    def report(self, info: RunInfo, trace: Trace, history: ContactHistory) -> Report:
        """The report of a run of at least one step."""
        settled = trace.t >= self._settled_s - 0.5 * self._scenario.physics.timestep
        tilt = self._tilt(trace, settled)
        torque = self._torque(trace)
        contacts = {
            name: _contact(i, trace, history, settled)
            for i, name in enumerate(self._scenario.contact_names)
        }
        if info.interrupted:
            verdict = Verdict.INTERRUPTED
            failures = [f"The run was interrupted at {trace.t[-1]:.2f} s."]
        else:
            found = self._contact_failures(trace, history, settled, contacts)
            found += self._tilt_failures(tilt, trace, settled)
            found += self._torque_failures(torque, trace) + _synthesis_failures(trace)
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
            tilt=tilt,
            contacts=contacts,
            torque=torque,
            synthesis=_synthesis(trace),
            timing=TimingReport(sim_s, info.wall_s, sim_s / info.wall_s),
            recording=info.recording,
        )

    def _tilt(self, trace: Trace, settled: Mask) -> TiltReport:
        error = np.degrees(trace.tilt - trace.tilt_ref)[settled]
        return TiltReport(
            target_deg=self._scenario.path.angle_deg,
            final_deg=float(np.degrees(trace.tilt[-1])),
            rms_error_deg=_rms(error),
            max_error_deg=float(np.abs(error).max(initial=0.0)),
        )

    def _torque(self, trace: Trace) -> TorqueReport:
        share = np.maximum(trace.tau / self._tau_max, trace.tau / self._tau_min)
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
        settled: Mask,
        contacts: dict[str, ContactReport],
    ) -> list[_Failure]:
        limits, failures = self._scenario.tolerances, []
        for i, (name, contact) in enumerate(contacts.items()):
            lost = settled & ~history.kept[:, i]
            # What a contact does once it has let go is no news.
            held = settled & ~np.logical_or.accumulate(lost)
            if lost.any():
                share = 100 * contact.kept_fraction
                text = f"Contact {name} let go at {{when}}; it was kept {share:.1f} % of the time."
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
            used = held & (history.utilisation[:, i] > limits.utilisation)
            if used.any():
                text = (
                    f"Contact {name} used {100 * contact.max_utilisation:.0f} % of its friction "
                    f"(allowed {100 * limits.utilisation:.0f} %), first at {{when}}."
                )
                failures.append(_failure(trace, used, text))
            peak = float(np.abs(trace.w_command_C[:, i, N]).max())
            if not lost.any() and contact.force_error_rms_n > limits.force_error * peak:
                text = (
                    f"Contact {name} followed its commanded normal force only to "
                    f"{contact.force_error_rms_n:.3g} N RMS "
                    f"(allowed {limits.force_error * peak:.3g} N)."
                )
                failures.append(_failure(trace, settled, text))
        return failures

    def _tilt_failures(self, tilt: TiltReport, trace: Trace, settled: Mask) -> list[_Failure]:
        limits, failures = self._scenario.tolerances, []
        off = settled & (np.degrees(np.abs(trace.tilt - trace.tilt_ref)) > limits.error_deg)
        if off.any():
            text = (
                f"The tilt was off by more than the allowed {limits.error_deg:g} deg at {{when}}; "
                f"{tilt.max_error_deg:.3g} deg at worst."
            )
            failures.append(_failure(trace, off, text))
        if abs(tilt.final_deg - tilt.target_deg) > limits.final_deg:
            text = (
                f"The tilt ended at {tilt.final_deg:.2f} deg instead of {tilt.target_deg:g} +- "
                f"{limits.final_deg:g} deg."
            )
            failures.append(_Failure(float(trace.t[-1]), text))
        return failures

    def _torque_failures(self, torque: TorqueReport, trace: Trace) -> list[_Failure]:
        cut = np.any(trace.saturated, axis=1)
        if not cut.any():
            return []
        joint = self._joints[int(np.argmax(trace.saturated[np.argmax(cut)]))]
        share = 100 * torque.saturated_fraction
        text = f"Torques were cut {share:.1f} % of the time, first that of {joint} at {{when}}."
        return [_failure(trace, cut, text)]


@dataclass(frozen=True)
class _Failure:
    t: float
    text: str


def _failure(trace: Trace, mask: Mask, text: str) -> _Failure:
    """A failure at the first row of a mask; ``{when}`` in its text becomes time and tilt."""
    first = int(np.argmax(mask))
    when = f"{trace.t[first]:.2f} s (tilt {abs(np.degrees(trace.tilt[first])):.1f} deg)"
    return _Failure(float(trace.t[first]), text.replace("{when}", when))


def _contact(i: int, trace: Trace, history: ContactHistory, settled: Mask) -> ContactReport:
    if not settled.any():
        return ContactReport(*(0.0 for _ in range(7)))
    kept = history.kept[settled, i]
    held = np.logical_and.accumulate(kept)
    normal = history.w_OC_C[settled, i, N]
    return ContactReport(
        kept_fraction=float(kept.mean()),
        slip_mm=1e3 * float(history.slip[settled, i].max()),
        slide_mm=1e3 * float(history.slide[settled, i].max()),
        spin_deg=float(np.degrees(np.abs(history.spin[settled, i]).max())),
        max_utilisation=float(history.utilisation[settled, i][held].max(initial=0.0)),
        max_normal_n=float(normal.max()),
        force_error_rms_n=_rms(normal - trace.w_command_C[settled, i, N]),
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
    text = f"The synthesis found no forces {count} times, first at {{when}}; the last were kept."
    return [_failure(trace, failed, text)]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
