"""Cross-check of a run in two engines and at half the step: where do the results differ?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.sim.evaluation import Category, Report, Verdict
from fulcrum.sim.motion import Schedule
from fulcrum.sim.plant import Engine, check_installed
from fulcrum.sim.run.execute import Request, Result, execute
from fulcrum.sim.run.preparation import Preparation, prepare
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Progress
from fulcrum.sim.world import World
from fulcrum.synthesis.arrays import N, T


@dataclass(frozen=True)
class Variant:
    """A way to simulate a run.

    Attributes:
        engine: Engine that simulates the plant.
        substeps: Physics steps per step of the scenario.
    """

    engine: Engine
    substeps: int = 1

    @property
    def name(self) -> str:
        """Name in tables and figures."""
        return self.engine.value + ("" if self.substeps == 1 else ", half step")


REFERENCE = Variant(Engine.MUJOCO)
VARIANTS = (
    REFERENCE,
    Variant(Engine.DRAKE),
    Variant(Engine.MUJOCO, 2),
    Variant(Engine.DRAKE, 2),
)


@dataclass(frozen=True)
class Bounds:
    """The largest differences between variants that agree; slip is left out: it is numerical creep.

    Attributes:
        final_deg: Difference of the final tilt [deg].
        error_deg: Difference of the largest tilt error [deg].
        hand: RMS of the difference of a hand's normal forces over their peak [-].
    """

    final_deg: float = 0.1
    error_deg: float = 0.1
    hand: float = 0.02


@dataclass(frozen=True)
class ContactDifference:
    """The difference of one contact while the object is held with full grip.

    Attributes:
        normal_rms_n: RMS of the difference of the normal forces [N].
        peak_n: Largest normal force of the reference [N].
        tangential_rms_n: RMS of the length of the difference of the tangential forces [N].
        slip_mm: Slip in the variant [mm].
    """

    normal_rms_n: float
    peak_n: float
    tangential_rms_n: float
    slip_mm: float

    @property
    def normal_share(self) -> float:
        """RMS of the difference of the normal forces over their peak [-]."""
        return self.normal_rms_n / self.peak_n if self.peak_n > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Comparison:
    """The comparison of one variant of a run with the reference.

    Attributes:
        variant: Way in which the run was simulated.
        result: Result of the run.
        contacts: Differences by contact, hands first.
        disagreements: Differences beyond the bounds, in words.
    """

    variant: Variant
    result: Result
    contacts: dict[str, ContactDifference]
    disagreements: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Crosscheck:
    """The cross-check of one world: all its variants, the reference first.

    Attributes:
        label: Label of the world.
        comparisons: One comparison for each variant.
    """

    label: str
    comparisons: tuple[Comparison, ...]

    @property
    def agrees(self) -> bool:
        """Whether no variant differs by more than the bounds."""
        return not any(comparison.disagreements for comparison in self.comparisons)


def crosscheck(
    request: Request,
    worlds: dict[str, tuple[World, int]],
    variants: tuple[Variant, ...] = VARIANTS,
    bounds: Bounds = Bounds(),
    progress: Progress | None = None,
) -> Iterator[Crosscheck]:
    """Run all variants of each world.

    Args:
        request: Run to simulate; its folder, world and seed are ignored.
        worlds: Worlds and seeds by label.
        variants: Ways to simulate; the first is the reference.
        bounds: Largest differences between variants that agree.
        progress: Called with runs done and runs in total.

    Raises:
        InvalidInputError: An engine is not installed, or the scenario contradicts itself.
        PathError: The arms cannot follow the path.
        PlanError: The planned tilt breaks a limit.
    """
    for variant in variants:
        check_installed(variant.engine)
    prepared = prepare(request.scenario, request.settings, planning=request.planning, check=False)
    total, done = len(worlds) * len(variants), 0
    for label, (world, seed) in worlds.items():
        own = replace(request, world=world, seed=seed, out=None, live=False)
        comparisons: list[Comparison] = []
        for variant in variants:
            result = run_variant(own, variant, prepared)
            reference = comparisons[0].result if comparisons else result
            comparisons.append(compare(variant, result, reference, own.scenario, bounds))
            done += 1
            if progress is not None:
                progress(done, total)
        yield Crosscheck(label, tuple(comparisons))


def run_variant(request: Request, variant: Variant, prepared: Preparation) -> Result:
    """Run a request in a variant; the rows of the trace are at the scenario's own step."""
    physics = request.scenario.physics
    step = physics.timestep / variant.substeps
    scenario = replace(request.scenario, physics=replace(physics, timestep=step))
    execution = prepared.execution
    if execution is not None:
        finer = replace(execution.scenario, physics=replace(physics, timestep=step))
        prepared = replace(prepared, execution=replace(execution, scenario=finer))
    result = execute(replace(request, scenario=scenario, engine=variant.engine), prepared=prepared)
    if variant.substeps == 1:
        return result
    rows = np.arange(0, len(result.trace), variant.substeps)
    history = result.history.pick(rows)
    return Result(result.report, result.trace.pick(rows), history, result.error)


def compare(
    variant: Variant, result: Result, reference: Result, scenario: Scenario, bounds: Bounds
) -> Comparison:
    """Compare a run of a scenario with the reference; forces are compared during full grip only.

    Before and after that, the object also stands on contacts that are not in the scenario.
    """
    ours, theirs = result.history.w_measured_C, reference.history.w_measured_C
    rows = min(len(ours), len(theirs))
    held = Schedule(scenario).held[reference.trace.phase[:rows]]
    off = (ours[:rows] - theirs[:rows])[held] if held.any() else ours[:rows] - theirs[:rows]
    normal = np.sqrt(np.mean(off[..., N] ** 2, axis=0)).tolist()
    across = np.sqrt(np.mean(np.sum(off[..., T:N] ** 2, axis=-1), axis=0)).tolist()
    peaks = theirs[..., N].max(axis=0).tolist()
    contacts = {
        name: ContactDifference(normal[i], peaks[i], across[i], contact.slip_mm)
        for i, (name, contact) in enumerate(result.report.contacts.items())
    }
    found = _disagreements(result, reference, contacts, len(scenario.hands), bounds)
    return Comparison(variant, result, contacts, tuple(found))


def _disagreements(
    result: Result,
    reference: Result,
    contacts: dict[str, ContactDifference],
    hands: int,
    bounds: Bounds,
) -> Iterator[str]:
    ours, theirs = result.report, reference.report
    if ours.outcome != theirs.outcome:
        yield f"outcome {ours.outcome} instead of {theirs.outcome}"
    if ours.verdict != theirs.verdict:
        sentences = (*ours.sentences, *theirs.sentences)
        yield f"verdict {ours.verdict} instead of {theirs.verdict}: {sentences[0]}"
    elif ours.verdict is Verdict.FAIL and not causes(ours) & causes(theirs):
        yield f"fails otherwise: {ours.sentences[0]} instead of: {theirs.sentences[0]}"
    final = abs(ours.tilt.final_deg - theirs.tilt.final_deg)
    if not final <= bounds.final_deg:
        yield f"final tilt off by {final:.3f} deg (bound {bounds.final_deg:g} deg)"
    error = abs(ours.tilt.max_error_deg - theirs.tilt.max_error_deg)
    if not error <= bounds.error_deg:
        yield f"largest tilt error off by {error:.3f} deg (bound {bounds.error_deg:g} deg)"
    for name in list(contacts)[:hands]:
        share = contacts[name].normal_share
        if not share <= bounds.hand:
            yield (
                f"normal force of {name} off by {100 * share:.2f} % of its peak RMS "
                f"(bound {100 * bounds.hand:g} %)"
            )


def causes(report: Report) -> set[Category]:
    """Return the categories of the failures in a report."""
    return {failure.category for failure in report.failures}
