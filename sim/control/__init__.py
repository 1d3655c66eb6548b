"""The controller, from measured state to torques: synthesis, drives, reaction, observer, guard."""

from fulcrum.sim.control.controller import ForceController
from fulcrum.sim.control.protocol import Controller
