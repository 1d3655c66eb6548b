"""The layout of a recording in the viewer: the scene beside the curves for review."""

from __future__ import annotations

import rerun.blueprint as rrb

from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.arrays import Array

TIMELINE = "time"
_BACKGROUND = (222, 226, 232)

_CURVES = (
    ("tilt", "Tilt [deg]", rrb.Corner2D.RightBottom),
    ("tilt_rate", "Tilt rate [deg/s]", rrb.Corner2D.RightTop),
    ("tilt_error", "Tilt error [deg]", rrb.Corner2D.RightBottom),
    ("normal_force", "Normal force [N]", rrb.Corner2D.RightTop),
    ("utilisation", "Friction utilisation [-]", rrb.Corner2D.RightTop),
    ("slip", "Slip [mm]", rrb.Corner2D.LeftTop),
    ("torque", "Torque over its limit [-]", rrb.Corner2D.RightTop),
    ("synthesis", "Synthesis time [us]", rrb.Corner2D.RightTop),
)


def blueprint(scenario: Scenario, center: Array) -> rrb.Blueprint:
    """Return the layout of a scenario.

    Args:
        scenario: Scenario that is recorded.
        center: Point in the world relative to which the 3D view is placed [m], (3,).
    """
    view = scenario.view
    eye = rrb.EyeControls3D(position=center + view.eye, look_target=center + view.target)
    scene = rrb.Spatial3DView(
        origin="/",
        contents=["/world/**", "/forces/**", "/cones/**"],
        name=scenario.name,
        eye_controls=eye,
        background=_BACKGROUND,
    )
    curves = [
        rrb.TimeSeriesView(origin=f"plots/{name}", name=title, plot_legend=corner)
        for name, title, corner in _CURVES
    ]
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="verdict", name="Verdict"),
        rrb.TextDocumentView(origin="config", name="Config"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                scene, rrb.StateTimelineView(origin="phase", name="Phase"), row_shares=[7, 1]
            ),
            rrb.Grid(*curves, texts, grid_columns=2),
            column_shares=[5, 6],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )
