"""Rerun recordings of runs; the only package that imports rerun."""

from fulcrum.sim.recording.cut import readable
from fulcrum.sim.recording.recorder import Recorder
from fulcrum.sim.recording.viewer import (
    headless_viewer,
    open_viewer,
    recording_file,
    screenshot,
    view,
)
