"""The picture of a scenario's feasibility: grip, torque and friction over the tilt."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

from fulcrum.sim.analysis.feasibility import Feasibility
from fulcrum.sim.scenario import Scenario

mpl.use("Agg")
from matplotlib import pyplot as plt


def draw(scenario: Scenario, controller: str, found: Feasibility, file: Path) -> None:
    """Write the picture as PNG; tilts without forces are red."""
    curves = found.curves
    canvas, axes = plt.subplots(3, 1, figsize=(8, 8), sharex=True, layout="constrained")
    for hand, grip in zip(scenario.hands, curves.grip.T, strict=True):
        axes[0].plot(curves.tilts_deg, grip, label=hand.name, lw=1.5)
        if np.isfinite(hand.f_n_max):
            axes[0].axhline(hand.f_n_max, color="k", lw=0.8, ls="--")
    axes[0].set_ylabel("grip [N]")
    axes[0].legend(fontsize=8)
    axes[1].plot(curves.tilts_deg, 100.0 * curves.torque, color="C2", lw=1.5)
    axes[1].axhline(100.0, color="k", lw=0.8, ls="--")
    axes[1].set_ylabel("torque, most used limit [%]")
    for label, used, style in (
        ("with this grip", curves.used, "-"),
        ("at best", curves.least_used, ":"),
    ):
        margin = 100.0 * (1.0 - used)
        axes[2].plot(curves.tilts_deg, margin, style, color="C1", label=label, lw=1.5)
    axes[2].axhline(0.0, color="k", lw=0.8, ls="--")
    axes[2].set_ylabel("friction margin [%]")
    axes[2].legend(fontsize=8)
    axes[2].set_xlabel("tilt [deg]")
    missing = curves.tilts_deg[~np.isfinite(curves.used)]
    step = float(curves.tilts_deg[1] - curves.tilts_deg[0])
    for ax in axes:
        ax.grid(alpha=0.3)
        for tilt in missing:
            ax.axvspan(tilt - step / 2, tilt + step / 2, color="red", alpha=0.15, lw=0)
    verdict = "feasible" if found.feasible else "not feasible"
    without = "" if found.unreachable is None else ", without the arms, which cannot follow"
    canvas.suptitle(f"{scenario.name}, controller {controller}: {verdict}{without}")
    canvas.savefig(file, dpi=110)
    plt.close(canvas)
