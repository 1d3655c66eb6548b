"""Rerun recordings of runs; the only package that imports rerun."""

from sim.recording.recorder import Recorder

__all__ = ["Recorder"]
