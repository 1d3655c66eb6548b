"""The picture of a search for a placement: before and after over the tilt, and its progress."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

from fulcrum.sim.geometry import GRAVITY
from fulcrum.sim.motion import PathError
from fulcrum.sim.placement.search import Placement
from fulcrum.sim.placement.value import over_tilt
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.synthesis.arrays import Array

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

# Steps of the tilt [deg].
_STEP_DEG = 5.0
# Placements without forces cost at least this (see `value`); they are not drawn.
_INFEASIBLE = 1.0


def draw(before: Scenario, found: Placement, control: Control, file: Path) -> None:
    """Write the picture as PNG.

    Args:
        before: Scene before the search.
        found: Result of the search.
        control: Settings of the controller, which gave the margins.
        file: Picture to write.
    """
    canvas, axes = plt.subplots(2, 2, figsize=(10, 7), layout="constrained")
    panels = axes.ravel()
    for scene, label, style in ((before, "before", "C7--"), (found.scenario, "after", "C0-")):
        try:
            tilts, curves = over_tilt(scene, control, _STEP_DEG)
        except PathError:
            label, tilts, curves = f"{label}: the arms cannot follow", np.empty(0), None
        values = [np.empty(0)] * 3 if curves is None else list(curves)
        for ax, curve in zip(panels, values, strict=False):
            ax.plot(tilts, curve, style, lw=1.5, label=label)
    weight = before.object.mass * GRAVITY
    panels[0].axhline(weight, color="k", lw=0.8, ls=":", label="its weight")
    panels[0].set_yscale("log")
    _named(panels[0], "heaviest object [N]")
    _named(panels[1], "friction used, at the least [%]")
    _named(panels[2], "torque used, at the least [%]")
    for ax in panels[:3]:
        ax.set_xlabel("tilt [deg]")
        ax.legend(fontsize=8)
    done, costs = np.array(found.history).T
    shown: Array = np.where(costs < _INFEASIBLE, costs, np.nan)
    panels[3].step(done, shown, where="post", color="C2")
    _named(panels[3], f"cost, goal {found.goal}")
    panels[3].set_xlabel("placements looked at")
    canvas.suptitle(f"{before.name}: placement for {found.goal}")
    canvas.savefig(file, dpi=110)
    plt.close(canvas)


def _named(ax: Axes, label: str) -> None:
    ax.set_ylabel(label)
    ax.grid(alpha=0.3)
    if ax.get_yscale() == "linear":
        ax.set_ylim(bottom=0.0)
