"""Planned tilts as they are executed, each made once per process, and what they must keep to."""

import functools
from dataclasses import replace

import numpy as np

from fulcrum.scenarios import scenario
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.planning.execution import Planning, planned_tilt
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.run.preparation import Preparation
from fulcrum.sim.scenario.control import controllers
from fulcrum.sim.world.world import NO_DEVIATION
from tests.helpers.runs import settled


@functools.cache
def execution(name, stretch):
    return planned_tilt(scenario(name), Planning(stretch))


def preparation(planned):
    """What a run of an execution needs beside the control."""
    robot = RobotModel(planned.scenario)
    return Preparation(robot, planned.joint_path, planned.grip, planned)


@functools.cache
def executed(name, stretch, world=NO_DEVIATION, **changes):
    """A run of a planned tilt by the controller for it, with changes of its settings."""
    s = scenario(name)
    control = replace(controllers(s.control)["dynamic"], **changes)
    request = Request(s, "dynamic", control, world=world, planning=Planning(stretch))
    return execute(request, prepared=preparation(execution(name, stretch)))


@functools.cache
def executed_as(name, planning, world=NO_DEVIATION):
    """The same of a plan that is asked for in another way."""
    s = scenario(name)
    control = controllers(s.control)["dynamic"]
    request = Request(s, "dynamic", control, world=world, planning=planning)
    return execute(request, prepared=preparation(planned_tilt(s, planning)))


def longest(flags):
    """The most steps in a row for which one of the columns is set."""
    edges = [np.flatnonzero(np.diff([0, *column, 0])) for column in (flags > 0.0).T.astype(int)]
    return max((int((e[1::2] - e[::2]).max()) for e in edges if len(e)), default=0)


def broken(name, result):
    """Which bars a run does not keep to, from trace and history alone."""
    trace, history, rows = result.trace, result.history, settled(name, result.trace)
    error_deg = np.degrees(np.abs(trace.tilt - trace.tilt_ref))
    kept = {
        "upright": abs(np.degrees(trace.tilt[-1]) - scenario(name).path.angle_deg) <= 0.5,
        "contacts": bool(history.kept[rows].all()),
        "slip": 1e3 * history.slip[rows].max() <= 1.0,
        "tracking": error_deg.max() <= 1.0,
        "torque": longest(trace.saturated) <= 20,
    }
    return {bar for bar, is_kept in kept.items() if not is_kept}
