"""Many episodes in many worlds: how often each controller succeeds, and why it fails where not."""

from sim.sweep.criteria import Criteria, Violation, violations
from sim.sweep.design import Episode, Sweep
from sim.sweep.farm import LostEpisodesError, Workers, run_sweep
from sim.sweep.parameters import PARAMETERS, overridden, parse_grid, parse_values
from sim.sweep.picture import draw_map
from sim.sweep.store import Store
from sim.sweep.summary import Cause, Score, scores

__all__ = [
    "PARAMETERS",
    "Cause",
    "Criteria",
    "Episode",
    "LostEpisodesError",
    "Score",
    "Store",
    "Sweep",
    "Violation",
    "Workers",
    "draw_map",
    "overridden",
    "parse_grid",
    "parse_values",
    "run_sweep",
    "scores",
    "violations",
]
