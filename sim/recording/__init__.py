"""Rerun recordings of runs; the only package that imports rerun."""

from sim.recording.cut import readable
from sim.recording.recorder import Recorder
from sim.recording.viewer import headless_viewer, open_viewer, recording_file, screenshot, view

__all__ = [
    "Recorder",
    "headless_viewer",
    "open_viewer",
    "readable",
    "recording_file",
    "screenshot",
    "view",
]
