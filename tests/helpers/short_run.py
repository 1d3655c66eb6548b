"""A short run that passes, and how to tamper with it: shared by the tests of the report."""

from dataclasses import replace
from functools import cache

import numpy as np

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation.judge import Judge
from fulcrum.sim.evaluation.report import RunInfo
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.scenario.phases import Phase


def short_tilt(angle_deg, tilt_s):
    """The first degrees of the box tilt, from hands that nearly touch; grip stands at 0.6 s."""
    phases = (
        Phase("touch", 0.2, tilt=0.0, gap=0.0, grip=0.0),
        Phase("grip", 0.4, tilt=0.0, gap=0.0, grip=1.0),
        Phase("tilt", tilt_s, tilt=1.0, gap=0.0, grip=1.0),
        Phase("hold", 0.1, tilt=1.0, gap=0.0, grip=1.0),
    )
    box = scenario("box-tilt")
    path = replace(box.path, angle_deg=angle_deg)
    return replace(box, standoff=0.002, phases=phases, path=path)


# A run of 2.7 s that passes.
SCENARIO = short_tilt(10.0, 2.0)
PHASES = SCENARIO.phases
LIMITS = SCENARIO.tolerances
LEFT, RIGHT, EDGE_LEFT, _ = range(4)
TOUCH_ROW, GRIP_ROW, ROW, LAST = 100, 400, 1700, 2699
INFO = RunInfo(controller="margin", objective="max-normal-force", seed=3, wall_s=2.0)


@cache
def short_run():
    """The run, made once per process."""
    return execute(Request(SCENARIO, "margin", SCENARIO.control))


def judge_of(scene, disturbed=False):
    """The judge of a scenario."""
    robot = RobotModel(scene)
    return Judge(scene, robot.joints, robot.tau_min, robot.tau_max, disturbed)


def changed(record, field, index, value):
    """A copy of a trace or history with some entries of one array set."""
    array = getattr(record, field).copy()
    array[index] = value
    return replace(record, **{field: array})


def gap(row):
    """The rows of a gap that counts as a loss of contact: longer than 5 ms."""
    return slice(row, row + 6)


def let_go(trace, history):
    """The trace, and a history in which the left edge lets go."""
    return trace, changed(history, "kept", (gap(ROW), EDGE_LEFT), False)


def when(trace, row):
    return f"{trace.t[row]:.2f} s (tilt {np.degrees(trace.tilt[row]):.1f} deg)"
