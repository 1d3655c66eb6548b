"""The evaluation of a run: contact monitor, judge, report."""

from fulcrum.sim.evaluation.checks import Checks
from fulcrum.sim.evaluation.failure import Category
from fulcrum.sim.evaluation.judge import Judge
from fulcrum.sim.evaluation.monitor import ContactHistory, Monitor
from fulcrum.sim.evaluation.outcome import Outcome
from fulcrum.sim.evaluation.report import Report, RunInfo, Verdict
