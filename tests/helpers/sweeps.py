"""A short sweep for the tests, and `fulcrum` with a short scene in the place of a long one.

As a script it is that `fulcrum` in a process of its own, which can be interrupted and killed.
"""

import signal
import sys
from pathlib import Path

from fulcrum.scenarios import scenarios
from fulcrum.scenarios.cli import main
from fulcrum.sim.sweep.design import Sweep
from tests.helpers.short_run import short_tilt

# Simulates 1.3 s: time enough for grip, and to lose it.
SCENE = short_tilt(3.0, 0.6)
ROOT = Path(__file__).parents[2]


def short_sweep(**changes):
    """Two controllers in worlds as in a laboratory."""
    settings = {"controllers": ("margin", "paper"), "preset": "lab", "episodes": 2, "seed": 5}
    return Sweep(SCENE, **{**settings, **changes})


if __name__ == "__main__":
    # As at a terminal; what starts the tests may ignore it, and children inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    scenarios()[SCENE.name] = SCENE
    sys.exit(main(sys.argv[1:]))
