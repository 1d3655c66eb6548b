"""The judge: verdict and outcome of a run, with the measurements that they depend on."""

from __future__ import annotations

import numpy as np

from fulcrum.sim.evaluation.checks import Checks, rms
from fulcrum.sim.evaluation.failure import Category, Failure
from fulcrum.sim.evaluation.monitor import ContactHistory
from fulcrum.sim.evaluation.outcome import Outcome, distance_off, measured_outcome
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
from fulcrum.sim.motion import Schedule
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Trace, stretches, torque_shares
from fulcrum.synthesis.arrays import Array, Mask, N


class Judge:
    """The judge of a scenario's runs, by its tolerances or by those for disturbed runs."""

    def __init__(
        self,
        scenario: Scenario,
        joints: tuple[str, ...],
        tau_min: Array,
        tau_max: Array,
        disturbed: bool = False,
        coupled: tuple[tuple[int, ...], ...] = (),
    ) -> None:
        """Choose the tolerances.

        Args:
            scenario: True scenario, as the plant has it.
            joints: Names of the driven joints.
            tau_min: Least torques of the joints [N·m or N], (l,).
            tau_max: Largest torques of the joints [N·m or N], (l,).
            disturbed: Whether to use the tolerances for disturbed runs, as the world of the runs
                may differ from the controller's model.
            coupled: Hands that share a load across; see :func:`sim.model.coupling.coupled_hands`.
        """
        self._scenario, self._joints, self._disturbed = scenario, joints, disturbed
        self._tau_min, self._tau_max = tau_min, tau_max
        self._schedule = Schedule(scenario)
        tolerances = scenario.tolerances.disturbed if disturbed else scenario.tolerances
        self._checks = Checks(scenario, joints, tolerances, coupled)

    def report(self, info: RunInfo, trace: Trace, history: ContactHistory) -> Report:
        """Return the report of a run of at least one step."""
        phase = trace.phase.astype(int)
        held = self._schedule.held[phase]
        free = self._schedule.free[phase]
        tilt = self._tilt(trace)
        contacts = {
            name: self._contact(i, trace, history, held, free)
            for i, name in enumerate(self._scenario.contact_names)
        }
        failures: tuple[Failure, ...]
        if info.interrupted:
            verdict, outcome, t = Verdict.INTERRUPTED, Outcome.INTERRUPTED, float(trace.t[-1])
            text = f"The run was interrupted at {t:.2f} s."
            failures = (Failure(t, Category.INTERRUPTED, "", text),)
        else:
            failures = self._checks.failures(info, trace, history, tilt, contacts)
            diverged = info.error is not None
            outcome = Outcome.DIVERGED if diverged else measured_outcome(self._scenario, trace)
            if outcome is Outcome.DROPPED:
                text = "The object fell, toppled, slid away or was let go."
                failures += (Failure(float(trace.t[-1]), Category.DROPPED, "", text),)
            verdict = Verdict.FAIL if failures else Verdict.PASS
        sim_s = len(trace) * self._scenario.physics.timestep
        return Report(
            scenario=self._scenario.name,
            controller=info.controller,
            objective=info.objective,
            seed=info.seed,
            disturbed=self._disturbed,
            verdict=verdict,
            outcome=outcome,
            failures=failures,
            events=info.events,
            phases=self._phases(trace),
            tilt=tilt,
            contacts=contacts,
            torque=self._torque(trace),
            synthesis=_synthesis(trace),
            timing=TimingReport(sim_s, info.wall_s, sim_s / info.wall_s),
            recording=info.recording,
        )

    def _contact(
        self, i: int, trace: Trace, history: ContactHistory, held: Mask, free: Mask
    ) -> ContactReport:
        impact = float(history.w_measured_C[free, i, N].max(initial=0.0))
        if not held.any():
            return ContactReport(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, impact, 0.0)
        kept = history.kept[held, i]
        holding = ~np.logical_or.accumulate(self._checks.lost(i, history, held))[held]
        normal = history.w_measured_C[held, i, N]

        def largest(quantity: Array) -> float:
            return float(quantity[held, i][holding & kept].max(initial=0.0))

        return ContactReport(
            kept_fraction=float(kept.mean()),
            slip_mm=1e3 * largest(history.slip),
            slide_mm=1e3 * largest(history.slide),
            spin_deg=float(np.degrees(largest(np.abs(history.spin)))),
            max_utilisation=largest(history.utilisation),
            max_normal_n=float(normal.max()),
            force_error_rms_n=rms(normal - trace.w_commanded_C[held, i, N]),
            free_normal_n=impact,
            longest_gap_ms=1e3
            * self._scenario.physics.timestep
            * int(stretches(~kept).max(initial=0)),
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
            final_mm=1e3 * distance_off(self._scenario, trace, np.radians(target)),
            rms_error_deg=rms(error),
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


def _synthesis(trace: Trace) -> SynthesisReport:
    times = 1e6 * trace.synthesis_s[trace.synthesis_s > 0.0]
    p50, p99 = np.percentile(times, [50, 99]) if times.size else (0.0, 0.0)
    return SynthesisReport(len(times), int(trace.failed.sum()), float(p50), float(p99))
