"""The figure of a cross-check: tilt errors and normal forces of all variants of one world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fulcrum.sim.run.crosscheck import Crosscheck
from fulcrum.synthesis.arrays import N

# Colours of the engines; lines of variants with smaller steps are dashed.
_COLORS = {"mujoco": "C0", "drake": "C1"}


def draw_crosscheck(title: str, check: Crosscheck, path: Path) -> None:
    """Draw tilt error and normal forces over time, and their differences, as PNG.

    Args:
        title: Title of the figure.
        check: Variants to draw.
        path: Picture to write.
    """
    reference = check.comparisons[0]
    names = list(reference.contacts)
    figure = Figure(figsize=(11.0, 2.1 * (len(names) + 1)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(names) + 1, 2, sharex=True, squeeze=False)
    forces_0 = reference.result.history.w_measured_C[..., N]
    tilt_0 = np.degrees(reference.result.trace.tilt)
    for comparison in check.comparisons:
        trace, variant = comparison.result.trace, comparison.variant
        style = {
            "color": _COLORS[variant.engine.value],
            "ls": "-" if variant.substeps == 1 else ":",
            "lw": 1.0,
            "label": variant.name,
        }
        rows = min(len(trace), len(tilt_0))
        tilt = np.degrees(trace.tilt)
        forces = comparison.result.history.w_measured_C[..., N]
        panels[0, 0].plot(trace.t, tilt - np.degrees(trace.tilt_ref), **style)
        panels[0, 1].plot(trace.t[:rows], tilt[:rows] - tilt_0[:rows], **style)
        for i, (force, off) in enumerate(panels[1:]):
            force.plot(trace.t, forces[:, i], **style)
            off.plot(trace.t[:rows], forces[:rows, i] - forces_0[:rows, i], **style)
    panels[0, 0].set_ylabel("tilt error [deg]")
    panels[0, 0].legend(fontsize=7)
    for axes, name in zip(panels[1:, 0], names, strict=True):
        axes.set_ylabel(f"{name} [N]")
    panels[0, 0].set_title("tilt error and normal forces", fontsize=9)
    panels[0, 1].set_title(f"minus that of {reference.variant.name}", fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    figure.suptitle(f"{title}; {check.label}", fontsize=10)
    figure.savefig(path, dpi=130)
