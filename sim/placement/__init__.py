"""Where to stand and where to hold: a search over bases, contacts and postures."""

from fulcrum.sim.placement.faces import coordinates
from fulcrum.sim.placement.freedom import Freedom
from fulcrum.sim.placement.page import placement_page
from fulcrum.sim.placement.search import Effort, Placement
from fulcrum.sim.placement.value import Goal
