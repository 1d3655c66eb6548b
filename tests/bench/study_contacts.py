"""Tables on contacts over scenes: pads from soft to hard, numerics, and worlds. Not a test.

Usage, from the project's folder, one table each:

    python -m tests.bench.study_contacts pads box-tilt panda-box
    python -m tests.bench.study_contacts numerics box-tilt
    python -m tests.bench.study_contacts worlds box-tilt --preset field --worlds 24

Each run takes some three seconds on an idle core, four times that with a quarter of the step.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.scenarios import scenario
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.run.execute import Request, Result, execute
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.trace import stretches
from fulcrum.sim.world.presets import draw, preset
from fulcrum.sim.world.world import NO_DEVIATION, World
from fulcrum.synthesis.arrays import Array, N

SCENES = ("box-tilt", "cylinder-tilt", "panda-box", "ur5-box", "cylinder-side", "box-wall")
PADS = (2e4, 4e4, 2e5, 1e6)  # [N/m]
USUAL_STEP = 0.001  # [s]


@dataclass(frozen=True)
class Numerics:
    """Settings of the solver that must not decide anything."""

    name: str
    timestep: float = USUAL_STEP
    impratio: float | None = None
    noslip: bool = True

    def of(self, scene: Scenario) -> Scenario:
        """The scene with these settings, and a synthesis as often as before."""
        physics = replace(
            scene.physics,
            timestep=self.timestep,
            impratio=self.impratio or scene.physics.impratio,
            noslip_iterations=scene.physics.noslip_iterations if self.noslip else 0,
        )
        every = scene.control.solve_every * round(USUAL_STEP / self.timestep)
        return replace(scene, physics=physics, control=replace(scene.control, solve_every=every))


VARIANTS = (
    Numerics("as shipped"),
    Numerics("0.5 ms", timestep=0.0005),
    Numerics("0.25 ms", timestep=0.00025),
    Numerics("no noslip", noslip=False),
    Numerics("impratio 1e3", impratio=1e3),
    Numerics("impratio 1e5", impratio=1e5),
)


def with_pads(scene: Scenario, stiffness: float) -> Scenario:
    """The scene with all hands' contacts of a stiffness [N/m]."""
    hands = (replace(h, material=replace(h.material, stiffness=stiffness)) for h in scene.hands)
    return replace(scene, hands=tuple(hands))


def run(scene: Scenario, controller: str, world: World = NO_DEVIATION, seed: int = 0) -> Result:
    return execute(Request(scene, controller, world=world, seed=seed))


def row(scene: Scenario, result: Result) -> str:
    """What a run showed: slip [mm], force errors over peaks, longest loss [ms], friction used."""
    report, trace, hands = result.report, result.trace, len(scene.hands)
    peaks = np.abs(trace.w_commanded_C[:, :, N]).max(axis=0)
    contacts = list(report.contacts.values())
    errors = np.array([c.force_error_rms_n for c in contacts]) / np.maximum(peaks, 1e-9)
    held = Schedule(scene).held[trace.phase.astype(int)]
    lost = max(stretches(held & ~kept).max() for kept in result.history.kept.T)
    off = abs(report.tilt.final_deg - report.tilt.target_deg)
    return (
        f"{report.verdict} | tilt off {off:.2f} deg"
        f" | slip {max(c.slip_mm for c in contacts):.3f} mm"
        f" | hands {100.0 * errors[:hands].max():.2f} %"
        f" | supports {100.0 * errors[hands:].max(initial=0.0):.2f} %"
        f" | lost {1e3 * lost * scene.physics.timestep:.0f} ms"
        f" | friction {100.0 * max(c.max_utilisation for c in contacts):.0f} %"
    )


def pads(name: str, controller: str) -> Iterator[str]:
    for stiffness in PADS:
        scene = with_pads(scenario(name), stiffness)
        yield f"{name} | {stiffness:g} N/m | {row(scene, run(scene, controller))}"


def numerics(name: str, controller: str) -> Iterator[str]:
    """Also how far each normal force is from that of the first variant, RMS over its peak."""
    first: Array | None = None
    for variant in VARIANTS:
        scene = variant.of(scenario(name))
        result = run(scene, controller)
        forces = result.history.w_measured_C[:: round(USUAL_STEP / variant.timestep), :, N]
        first = forces if first is None else first
        steps = min(len(first), len(forces))
        off = np.sqrt(np.mean((forces[:steps] - first[:steps]) ** 2, axis=0)) / first.max(axis=0)
        shown = " ".join(f"{100.0 * share:.2f}" for share in off)
        yield f"{name} | {variant.name} | forces off {shown} % | {row(scene, result)}"


def worlds(
    name: str, controller: str, which: str, count: int, stiffness: float, unequal: float
) -> Iterator[str]:
    """Worlds of a preset; pads of one stiffness, or one stiffer and one softer by a share."""
    scene = with_pads(scenario(name), stiffness)
    for seed in range(count):
        world = replace(draw(preset(which), scene, seed), stiffness=(1.0 + unequal, 1.0 - unequal))
        result = run(scene, controller, world, seed)
        yield f"{name} | {which} {seed} | {row(scene, result)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=("pads", "numerics", "worlds"))
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--controller", default="robust")
    parser.add_argument("--preset", default="field")
    parser.add_argument("--worlds", type=int, default=24)
    parser.add_argument("--stiffness", type=float, default=4e4)
    parser.add_argument("--unequal", type=float, default=0.0)
    given = parser.parse_args()
    for name in given.scenes:
        if given.table == "pads":
            lines = pads(name, given.controller)
        elif given.table == "numerics":
            lines = numerics(name, given.controller)
        else:
            settings = given.preset, given.worlds, given.stiffness, given.unequal
            lines = worlds(name, given.controller, *settings)
        for line in lines:
            print(line, flush=True)


if __name__ == "__main__":
    main()
