"""Sweeps, many runs in randomly drawn worlds: design, episodes, results, success rates."""

from fulcrum.sim.sweep.design import Sweep
from fulcrum.sim.sweep.farm import SweepResult, run_sweep
from fulcrum.sim.sweep.store import MAP, SUMMARY, Store
