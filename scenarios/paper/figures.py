"""Figures over the tilt, as pictures and as tables."""

from __future__ import annotations

import csv
import textwrap
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

from fulcrum.synthesis.arrays import Array

mpl.use("Agg")
from matplotlib import pyplot as plt

_CAPTION_WIDTH = 120


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity over the tilt, with its style in matplotlib."""

    name: str
    tilt_deg: Array
    value: Array
    style: str = "-"


@dataclass(frozen=True, eq=False)
class Figure:
    """Curves of one quantity over the tilt; ``name`` is the name of its files."""

    name: str
    title: str
    quantity: str
    caption: str
    curves: list[Curve]


def draw(figure: Figure, folder: Path) -> None:
    """Write a figure as PNG, and its numbers as CSV with one row per point."""
    with (folder / f"{figure.name}.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["curve", "tilt_deg", figure.quantity])
        for curve in figure.curves:
            for tilt, value in zip(curve.tilt_deg, curve.value, strict=True):
                table.writerow([curve.name, f"{tilt:.6g}", f"{value:.9g}"])
    canvas, axes = plt.subplots(figsize=(9, 5.6), layout="constrained")
    for curve in figure.curves:
        axes.plot(curve.tilt_deg, curve.value, curve.style, label=curve.name, ms=3, lw=1.5)
    axes.set(title=figure.title, xlabel="tilt [deg]", ylabel=figure.quantity)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, ncols=2)
    canvas.supxlabel(textwrap.fill(figure.caption, _CAPTION_WIDTH), fontsize=8)
    canvas.savefig(folder / f"{figure.name}.png", dpi=130)
    plt.close(canvas)
