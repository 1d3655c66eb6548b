r"""When the rest of a planned tilt is planned anew, by a stated rule.

==============================================  ===================================================
what happens during the tilt                    from where, at what rate
==============================================  ===================================================
the arms fall 0.5 deg behind, as a tilt         where the arms are, at their rate
a held run goes on                              where it was held, from rest
==============================================  ===================================================

How far the arms are behind counts along the path: with :math:`q(s)` the joint angles over the
share of the tilt, by :math:`\Delta s = q' \cdot (q_d - q) / \|q'\|^2`, and their rate by
:math:`\dot s = q' \cdot \dot q / \|q'\|^2`. The rest is planned in least time at the plan's own
stretch. If there is no such plan, as when they are too fast to stop in time, the timing stays.
Arms that are pushed ahead are left to the impedance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fulcrum.sim.motion.joint_path import JointPath
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.planning.execution import Execution, timed
from fulcrum.sim.planning.plan import PlanError, plan
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.signals.target import Target
from fulcrum.synthesis import SolverError

# How far the arms may fall behind [rad of tilt]; without disturbances it is a tenth of that.
_BEHIND = np.radians(0.5)
# Grid points of a whole path and of the shortest rest: a few percent of the time, in a quarter of
# the time that the plan itself takes.
_POINTS, _FEWEST = 30, 5
# Of the tilt; what is left is as good as done.
_DONE = 0.99


class Anew(NamedTuple):
    """A joint path whose rest is timed anew, and the path time at which that begins [s]."""

    joint_path: JointPath
    path_t: float


class Replanner:
    """Plans the rest of a tilt.

    Attributes:
        phase: Index of the phase that tilts.
        joint_path: How the arms follow the path as it is planned now.
    """

    def __init__(self, execution: Execution) -> None:
        self._nominal, self._scenario = execution.plan.scenario, execution.scenario
        self._pace, self._curve = execution.planning.stretch, execution.plan.q
        self._margins, self._end = execution.plan.margins, execution.joint_path.schedule.end
        self.phase, self.joint_path = execution.phase, execution.joint_path

    def behind(self, target: Target, seen: Measurement) -> float:
        """How far the arms are behind a target of the tilt, as a tilt [rad]."""
        slope = self.joint_path.at(self.phase, target.tilt / self._end)[1]
        return self._end * float(slope.dot(target.q - seen.q) / slope.dot(slope))

    def caught(self, target: Target, seen: Measurement) -> Anew | None:
        """The rest from where the arms are, if they have fallen behind."""
        behind = self.behind(target, seen)
        if behind <= _BEHIND:
            return None
        share = max(0.0, (target.tilt - behind) / self._end)
        slope = self.joint_path.at(self.phase, share)[1]
        return self.planned(share, max(0.0, float(slope.dot(seen.qd) / slope.dot(slope))))

    def rested(self, target: Target) -> Anew | None:
        """The rest from where a target of the tilt stands still."""
        return self.planned(target.tilt / self._end, 0.0)

    def planned(self, share: float, rate: float) -> Anew | None:
        """The rest from a share of the tilt [-], and a rate of that [1/s]; None without a plan."""
        if share >= _DONE:
            return None
        points = max(_FEWEST, round(_POINTS * (1.0 - share)))
        start_rate = rate * self._pace
        try:
            rest = plan(
                self._nominal,
                self._margins,
                points=points,
                start=share,
                start_rate=start_rate,
                curve=self._curve,
            )
        except (PlanError, SolverError):
            return None
        schedule = self.joint_path.schedule
        timing = schedule.phases[self.phase].timing
        assert timing is not None
        squared = np.maximum(rest.solution.b, 0.0) / self._pace**2
        again = timing.continued(rest.solution.problem.s, squared)
        phases = timed(self._scenario.phases, again)
        self._scenario = replace(self._scenario, phases=phases)
        self.joint_path = replace(self.joint_path, schedule=Schedule(self._scenario))
        path_t = float(schedule.starts[self.phase] + again.times(share))
        return Anew(self.joint_path, path_t)
