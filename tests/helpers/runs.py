"""Runs of every scenario, each made once per process, and what they must show."""

import functools
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.evaluation.judge import Judge
from fulcrum.sim.evaluation.monitor import ContactHistory, Monitor
from fulcrum.sim.evaluation.report import Report, RunInfo
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.scenario.control import Control, controllers
from fulcrum.sim.scenario.phases import REACH, Phase, stretched
from fulcrum.sim.scenario.scenario import Scenario
from fulcrum.sim.signals.trace import Trace
from fulcrum.synthesis.arrays import N
from tests.helpers.unguarded import UNGUARDED

NAMES = [name for name, s in scenarios().items() if s.holdable]  # see test_lift.py for the rest
BOX = "box-tilt"
# These are run in every way, the others by default and in one way that must fail: what else there
# is to catch does not depend on the scene, but on palms that press or fingers that pinch.
THOROUGH = (BOX, "cylinder-tilt")


class Case(NamedTuple):
    """A run of a scenario: what the controller believes, the controller, and what is true."""

    scenario: Scenario
    control: Control
    truth: Scenario | None = None
    seed: int = 0


class Outcome(NamedTuple):
    report: Report
    trace: Trace
    history: ContactHistory


def slippery(s, share):
    """The scenario with the friction of all its contacts scaled."""

    def scaled(contact):
        friction = replace(contact.friction, mu=share * contact.friction.mu)
        return replace(contact, friction=friction)

    return replace(s, hands=tuple(map(scaled, s.hands)), supports=tuple(map(scaled, s.supports)))


def softer(s):
    """Contacts of half the stiffness."""

    def halved(contact):
        return replace(contact, material=contact.material.scaled(0.5))

    return replace(s, hands=tuple(map(halved, s.hands)), supports=tuple(map(halved, s.supports)))


def without_noslip(s):
    """Stick by stiff friction rows alone, instead of the noslip solver."""
    return replace(s, physics=replace(s.physics, noslip_iterations=0))


HOLD_FLAT = Phase("hold", 0.2, tilt=0.0, gap=0.0, grip=1.0)


def half_way(s):
    """Tilts to half of the angle in half of the time, lets go and withdraws."""
    path = replace(s.path, angle_deg=s.path.angle_deg / 2.0)
    return replace(s, path=path, phases=stretched(s.phases, 4.0))


def hard(s):
    """Hands that come over their whole standoff in 0.3 s, grip and hold: nothing is tilted."""
    touch = Phase("touch", 0.3, tilt=0.0, gap=0.0, grip=0.0)
    return replace(s, phases=(touch, replace(touch, name="feel"), REACH[-1], HOLD_FLAT))


def clinging(s):
    """Hands that let go, but withdraw by no more than a micrometre."""
    stand = replace(s.phases[-1], duration_s=0.3, gap=1e-6)
    return replace(s, phases=(*s.phases[:-2], stand))


def wider(s):
    """A box that is 50 micrometres wider than believed on either side."""
    (body,) = s.object.geoms
    x, y, z = body.size
    return replace(s, object=replace(s.object, geoms=(replace(body, size=(x, y + 5e-5, z)),)))


def leaving(s):
    """Hands that come, hold, let go and withdraw; nothing is tilted."""
    let_go = Phase("let go", 0.5, tilt=0.0, gap=0.0, grip=0.0)
    withdraw = Phase("withdraw", 1.0, tilt=0.0, gap=s.standoff, grip=0.0)
    stand = replace(withdraw, name="stand", duration_s=0.2)
    return replace(s, phases=(*REACH, HOLD_FLAT, let_go, withdraw, stand))


def flat(s):
    """The scenario without its tilt: hands come, grip and hold."""
    return replace(s, phases=(*REACH, HOLD_FLAT))


def blocked(s):
    """A post that the belief does not know, on the left arm's way to the box."""
    post = Geom("post", "sphere", (0.05,), Pose((0.6, 0.375, 0.1)))
    return replace(s, environment=(*s.environment, post))


CASES = {
    "default": lambda s: Case(s, s.control),
    "again": lambda s: Case(s, s.control),
    "paper": lambda s: Case(s, controllers(s.control)["paper"]),
    "no-feedforward": lambda s: Case(s, controllers(s.control)["no-feedforward"]),
    "softer": lambda s: Case(softer(s), s.control),
    "without noslip": lambda s: Case(without_noslip(s), s.control),
    "slippery": lambda s: Case(s, s.control, truth=slippery(s, 0.7)),
    "no preload": lambda s: Case(s, replace(s.control, preload=0.0, guard=UNGUARDED)),
    "hasty": lambda s: Case(replace(s, phases=stretched(s.phases, 3.5)), s.control),
    "half way": lambda s: Case(half_way(s), s.control),
    "hard": lambda s: Case(hard(s), s.control),
    "clinging": lambda s: Case(clinging(s), s.control, truth=wider(clinging(s))),
    "leaving": lambda s: Case(leaving(s), s.control),
    "blocked": lambda s: Case(flat(s), s.control, truth=blocked(flat(s))),
}
FAILING = [
    (name, case)
    for case in ("paper", "no-feedforward", "slippery")
    for name in (NAMES if case == "paper" else THOROUGH)
]


@functools.cache
def run(name, case):
    s, control, truth, seed = CASES[case](scenario(name))
    loop = closed_loop(s, control, truth=truth, seed=seed)
    monitor = Monitor(truth or s)
    history = ContactHistory.concatenate([monitor.update(block) for block in loop.run()])
    robot = loop.robot
    judge = Judge(truth or s, robot.joints, robot.tau_min, robot.tau_max)
    info = RunInfo(case, control.objective, seed, wall_s=1.0, collisions=loop.plant.collisions)
    return Outcome(judge.report(info, loop.trace, history), loop.trace, history)


def rows_of(name, trace, *phases):
    """The steps in phases of these names."""
    names = [phase.name for phase in scenario(name).phases]
    return np.isin(trace.phase, [names.index(phase) for phase in phases])


def settled(name, trace):
    """The steps at which full grip is asked for, from the grip at both ends of each phase."""
    grips = np.array([0.0, *(phase.grip for phase in scenario(name).phases)])
    full = (grips[1:] == 1.0) & (grips[:-1] == 1.0)
    return full[trace.phase.astype(int)]


def violated(name, trace, history):
    """Which requirements a run violates, from trace and history alone, without the report."""
    s, rows = scenario(name), settled(name, trace)
    limits = s.tolerances
    error_deg = np.degrees(np.abs(trace.tilt - trace.tilt_ref))
    normal, command = history.w_measured_C[..., N], trace.w_commanded_C[..., N]
    # How supports at the same point share its force is indeterminate: see test_box_wall.py.
    points = [hand.p_OC_O for hand in s.hands] + [support.p_OP_O for support in s.supports]
    alone = [points.count(point) == 1 for point in points]
    rms = np.sqrt(np.mean((normal - command)[rows] ** 2, axis=0))
    peak = np.abs(command).max(axis=0)
    counts = len(s.hands), len(s.supports)
    share = np.repeat([limits.force_error, limits.support_force_error], counts)
    met = {
        "kept": bool((normal[rows] > 0.0).all()),
        "slip": 1e3 * history.slip[rows].max() <= limits.slip_mm,
        "slide": 1e3 * history.slide[rows].max() <= limits.slip_mm,
        "spin": np.degrees(np.abs(history.spin[rows]).max()) <= limits.spin_deg,
        "utilisation": history.utilisation[rows][:, alone].max() <= limits.utilisation,
        "force": bool((rms <= share * peak)[alone].all()),
        "tilt error": error_deg[rows].max() <= limits.error_deg,
        "final tilt": abs(np.degrees(trace.tilt[-1]) - s.path.angle_deg) <= limits.final_deg,
        "torque": not trace.saturated.any(),
        "synthesis": not trace.failed.any(),
    }
    return {requirement for requirement, is_met in met.items() if not is_met}
