"""The success map: share of successes of each controller over two parameters of the world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from fulcrum.sim.sweep.design import Sweep
from fulcrum.sim.world import PARAMETERS
from fulcrum.synthesis.arrays import Array

# Number of bins of a sampled parameter, which has no grid.
_BINS = 8
# Largest number of cells per side with numbers that can still be read.
_WRITTEN = 12
_COLORS = "RdYlGn"


def draw_map(rows: pa.Table, sweep: Sweep, pair: tuple[str, str], path: Path) -> None:
    """Draw the share of successes over two parameters as PNG, with a panel for each controller.

    A parameter of the grid has a cell for each of its values. A randomly drawn parameter is binned,
    and each failure is a cross.

    Args:
        rows: Table of the episodes, at least one.
        sweep: Sweep of the episodes.
        pair: Names of the parameters.
        path: Picture to write.
    """
    names = sweep.controllers
    figure = Figure(figsize=(0.8 + 4.4 * len(names), 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    grid = dict(sweep.grid)
    values = [np.array(rows[f"world.{name}"].to_pylist(), float) for name in pair]
    edges = [_edges(v, grid.get(name)) for name, v in zip(pair, values, strict=True)]
    controllers = np.array(rows["controller"].to_pylist())
    success = np.array(rows["success"].to_pylist())
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    for axes, name in zip(panels, names, strict=True):
        own = controllers == name
        x, y = values[0][own], values[1][own]
        _cells(axes, x, y, success[own], edges)
        if not set(pair) <= set(grid):
            failed = ~success[own]
            axes.plot(x[failed], y[failed], "kx", ms=3, mew=0.7, alpha=0.6)
        axes.set_title(f"{name}: {success[own].sum()} of {own.sum()}")
        axes.set_xlabel(_label(pair[0]))
    panels[0].set_ylabel(_label(pair[1]))
    figure.colorbar(panels[0].collections[0], ax=panels.tolist(), label="share of successes")
    each = f"worlds drawn: {sweep.episodes}" + (" at each point" if grid else "")
    crosses = "" if set(pair) <= set(grid) else "; crosses are failures"
    figure.suptitle(f"{sweep.scenario.name}, {sweep.preset}; {each}{crosses}", fontsize=10)
    figure.savefig(path, dpi=130)


def _cells(axes: Axes, x: Array, y: Array, success: Array, edges: list[Array]) -> None:
    count = np.histogram2d(x, y, edges)[0]
    good = np.histogram2d(x[success], y[success], edges)[0]
    share = np.where(count > 0, good / np.maximum(count, 1), np.nan)
    axes.set_facecolor("0.92")  # cells without episodes
    axes.pcolormesh(*edges, share.T, cmap=_COLORS, norm=Normalize(0.0, 1.0), alpha=0.8)
    if max(count.shape) > _WRITTEN:
        return
    middle = [(e[1:] + e[:-1]) / 2.0 for e in edges]
    for i, j in np.argwhere(count > 0):
        text = f"{good[i, j]:.0f}/{count[i, j]:.0f}"
        axes.text(middle[0][i], middle[1][j], text, ha="center", va="center", fontsize=6)


def _edges(values: Array, grid: tuple[float, ...] | None) -> Array:
    """Return the edges of cells: around each value of a grid, or of bins over drawn values."""
    if grid is None and np.ptp(values) > 0.0:
        return np.linspace(values.min(), values.max(), _BINS + 1)
    points = np.unique(values if grid is None else grid)
    if len(points) == 1:
        half = 0.05 * abs(points[0]) or 0.5
        return np.array([points[0] - half, points[0] + half])
    between = (points[1:] + points[:-1]) / 2.0
    first, last = 2.0 * points[0] - between[0], 2.0 * points[-1] - between[-1]
    return np.array([first, *between, last])


def _label(name: str) -> str:
    return f"{name.replace('_', ' ')} [{PARAMETERS[name].unit}]"
