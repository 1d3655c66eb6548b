"""Picture of a plan: tilt, forces, friction, torques and speeds over time."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

from fulcrum.sim.planning.plan import Plan
from fulcrum.synthesis.arrays import Array, N

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

# Number of joints that fit in a legend; those nearest to their limits are drawn.
_NAMED = 6


def draw(plan: Plan, file: Path) -> None:
    """Write the picture of a plan to a PNG file."""
    found = plan.solution
    t = plan.times[found.problem.stations[:, 0]]
    canvas, axes = plt.subplots(5, 1, figsize=(9, 13), sharex=True, layout="constrained")
    _motion(plan, axes[0])
    forces = found.w_OC_C[0][: len(t), :, N]
    contacts = [contact.name for contact in found.problem.loads[0].problems[0].contacts]
    for name, curve in zip(contacts, forces.T, strict=True):
        axes[1].plot(t, curve, label=name, lw=1.5)
    axes[1].set_ylabel("normal force [N]")
    _shares(axes[2], t, found.shares, "friction of ", "friction used [%]")
    _shares(axes[3], t, found.shares, "torque of ", "torque used [%]")
    _shares(axes[4], t, found.shares, "speed of ", "speed used [%]")
    for ax in axes[1:]:
        ax.legend(fontsize=7, loc=(1.01, 0.0))
    for ax in axes:
        ax.grid(alpha=0.3)
    axes[-1].set_xlabel("time [s]")
    canvas.suptitle(
        f"{plan.scenario.name}, {found.problem.objective}: {plan.duration:.3f} s for "
        f"{plan.scenario.path.angle_deg:g} deg; shares are of what the margins leave"
    )
    canvas.savefig(file, dpi=110)
    plt.close(canvas)


def _motion(plan: Plan, axes: Axes) -> None:
    times = np.linspace(0.0, plan.duration, 500)
    moments = [plan.at(float(t)) for t in times]
    axes.plot(times, np.degrees([m.tilt for m in moments]), color="C0", lw=1.5)
    axes.set_ylabel("tilt [deg]", color="C0")
    rates = axes.twinx()
    rates.plot(times, np.degrees([m.rate for m in moments]), color="C1", lw=1.5)
    rates.set_ylabel("rate [deg/s]", color="C1")


def _shares(axes: Axes, t: Array, shares: dict[str, Array], kind: str, label: str) -> None:
    own = {name: share for name, share in shares.items() if name.startswith(kind)}
    for name in sorted(own, key=lambda name: -own[name].max()):
        rank = [line.get_label() for line in axes.get_lines()]
        shown = name.removeprefix(kind) if len(rank) < _NAMED else None
        axes.plot(t, 100.0 * own[name][: len(t)], label=shown, lw=1.3, alpha=1.0 if shown else 0.3)
    axes.axhline(100.0, color="k", lw=0.8, ls="--")
    axes.set_ylabel(label)
