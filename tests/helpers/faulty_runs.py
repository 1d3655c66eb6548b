"""Runs in which something breaks, each made once per process and recorded."""

import functools
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.run.execute import Request, Result, execute
from fulcrum.sim.run.preparation import prepare
from fulcrum.sim.scenario.phases import stretched
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.world.faults import Fault, FaultKind
from fulcrum.sim.world.world import NO_DEVIATION, Push, World
from tests.helpers.short_run import short_tilt
from tests.helpers.unguarded import UNGUARDED

# Grip stands at 0.6 s; at 2 s the object is tilted by 13 deg.
TILT = short_tilt(30.0, 3.0)
LIMITS = RobotModel(TILT)
BEGIN = 2.0
# Margins use 85 % of the friction: past 78.1 deg no forces are found, though the plant has more.
TOO_FAR = scenario("cylinder-tilt")
TOO_FAR = replace(
    TOO_FAR, path=replace(TOO_FAR.path, angle_deg=83.0), phases=stretched(TOO_FAR.phases, 3.0)
)


def broken(kind, t=BEGIN, **options):
    """A world in which one thing breaks."""
    return World(faults=(Fault(kind, t, **options),))


def post(radius, *position):
    """A world with a sphere that nobody believes in."""
    return World(obstacles=(Geom("post", "sphere", (radius,), Pose(position)),))


class Case(NamedTuple):
    """What breaks, in which scenario, what the guard is to say of it, and what it is to do.

    Attributes:
        world: What is true.
        cause: A part of the words for the cause.
        reactions: What the guard is to do, in order.
        window: When it is to react first [s].
        scenario: What is believed.
    """

    world: World
    cause: str
    reactions: tuple[str, ...]
    window: tuple[float, float]
    scenario: Scenario = TILT


PASSES, LOWERS = ("hold", "run"), ("hold", "lower", "end")
KIND = FaultKind
CASES = {
    "no forces found": Case(
        NO_DEVIATION, "the synthesis finds no forces", LOWERS, (4.0, 6.3), TOO_FAR
    ),
    "contact lost": Case(
        World(pushes=(Push(BEGIN, 0.3, (0.0, 0.0, -60.0), (0.1, 0.0, 0.0)),)),
        "mm off ",
        ("hold", "stop"),
        (BEGIN, BEGIN + 0.1),
    ),
    "torque lost": Case(
        broken(KIND.TORQUE_LOST, joint="left_e0"),
        "the motor of left_e0 makes 0 instead of",
        ("stop",),
        (BEGIN, BEGIN + 0.1),
    ),
    # A joint that turns with the tilt. left_s0 squeezes: as the squeeze may move, its torque may
    # stick with a tilt error of 0.9 deg at most, and is 25 % of the limit off only at 2.1 s.
    "torque stuck": Case(
        broken(KIND.TORQUE_STUCK, t=1.2, joint="left_e0"),
        "the motor of left_e0 makes",
        ("stop",),
        (1.2, 1.8),
    ),
    "encoder dead": Case(
        broken(KIND.ENCODER_DEAD, joint="left_e1"),
        "the encoder of left_e1 gives no usable number",
        ("hold", "stop"),
        (BEGIN, BEGIN + 0.02),
    ),
    "encoder dead for a moment": Case(
        broken(KIND.ENCODER_DEAD, joint="left_e1", duration_s=0.011),
        "the encoder of left_e1 gives no usable number",
        PASSES,
        (BEGIN, BEGIN + 0.02),
    ),
    "encoder frozen": Case(
        broken(KIND.ENCODER_FROZEN, joint="left_s1"),
        "the encoder of left_s1 is frozen",
        ("hold", "stop"),
        (BEGIN, BEGIN + 0.1),
    ),
    "pose dead": Case(
        broken(KIND.POSE_DEAD),
        "the tracking of the object gives no usable number",
        LOWERS,
        (BEGIN, BEGIN + 0.1),
    ),
    "pose frozen": Case(
        broken(KIND.POSE_FROZEN),
        "the tracking of the object is frozen",
        LOWERS,
        (BEGIN, BEGIN + 0.2),
    ),
    "pose dead for a moment": Case(
        broken(KIND.POSE_DEAD, duration_s=0.15),
        "the tracking of the object gives no usable number",
        PASSES,
        (BEGIN, BEGIN + 0.1),
    ),
    "latency spike": Case(
        broken(KIND.SILENCE, duration_s=0.2), "no setpoint has arrived", PASSES, (2.0, 2.1)
    ),
    "wire cut": Case(broken(KIND.SILENCE), "no setpoint has arrived", LOWERS, (2.0, 2.1)),
    "twice as heavy": Case(World(mass=2.0), "the tilt is ", LOWERS, (0.7, 2.0)),
    "heavier in mid-tilt": Case(
        broken(KIND.WEIGHT, extra_n=20.0), "mm off ", ("hold", "stop"), (BEGIN, BEGIN + 0.2)
    ),
    "post over the wrist": Case(
        post(0.03, 0.70, 0.34, 0.21), "the tilt is ", ("hold", "stop"), (2.0, 2.8)
    ),
    "post beside the elbow": Case(
        post(0.05, 0.42, 0.58, 0.24), "the torque of left_s1 is cut", LOWERS, (1.0, 1.6)
    ),
}
# Faults of which a run without the guard is shown to end worse.
UNGUARDED_TOO = ("wire cut", "torque stuck")


@functools.cache
def faulty_run(name, guarded=True):
    """Result of a case and the file of its recording; without the guard there is none."""
    world, _, _, _, scene = CASES[name]
    control = scene.control if guarded else replace(scene.control, guard=UNGUARDED)
    out = Path(tempfile.mkdtemp()) / "run" if guarded else None
    request = Request(scene, "margin", control, world=world, out=out, disturbed=False)
    prepared = prepare(scene, control, check=scene is not TOO_FAR)
    return Faulty(execute(request, prepared=prepared), None if out is None else out / "run.rrd")


class Faulty(NamedTuple):
    result: Result
    recording: Path | None
