"""From measured state to torques: synthesis, drives, reaction, observer, and the guard."""

from fulcrum.sim.control.controller import ForceController
from fulcrum.sim.control.protocol import Controller
