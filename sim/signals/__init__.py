"""Data passed between the parts of the loop at run time, and the trace of a run."""

from fulcrum.sim.signals.command import Command
from fulcrum.sim.signals.event import Cause, Event, Finding, Mode, Reaction
from fulcrum.sim.signals.force import AppliedForce
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.signals.progress import Progress
from fulcrum.sim.signals.setpoint import Setpoint
from fulcrum.sim.signals.target import Target
from fulcrum.sim.signals.trace import Trace, stretches, torque_shares
