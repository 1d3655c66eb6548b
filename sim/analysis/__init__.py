"""Analysis of a scenario without a run: feasibility, capacity, limits, surroundings."""

from fulcrum.sim.analysis.capacity import capacities
from fulcrum.sim.analysis.explain import tightest_tilt
from fulcrum.sim.analysis.explanation import Explanation
from fulcrum.sim.analysis.feasibility import Feasibility
from fulcrum.sim.analysis.hard_contact import static_differences
