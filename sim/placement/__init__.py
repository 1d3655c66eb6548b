"""Placements of robots and hands: a search over bases, contacts and start postures."""

from fulcrum.sim.placement.faces import coordinates
from fulcrum.sim.placement.freedom import Freedom
from fulcrum.sim.placement.page import placement_page
from fulcrum.sim.placement.search import Effort, Placement
from fulcrum.sim.placement.value import Goal
