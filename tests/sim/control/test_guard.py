"""The guard's rule, row by row, and the clock that carries it out."""

import math

import numpy as np
import pytest

from fulcrum.sim.control.guard import Supervisor
from fulcrum.sim.motion.clock import PathClock
from fulcrum.sim.scenario.control import Guard
from fulcrum.sim.signals.event import Cause, Finding, Mode

STEP, CHECK = 0.001, 0.01
SETTINGS = Guard()
WAITED_FOR = [cause for cause in Cause if cause.name not in ("ENCODER", "MOTOR", "OBJECT")]


def reactions(cause, lasts_s, lowerable=True, path_s=2.0):
    """What a supervisor does about a cause that is found for a time; its path ends in between."""
    supervisor = Supervisor(SETTINGS)
    for t in np.arange(0.0, 10.0, CHECK).tolist():
        findings = [Finding(cause, "it")] if 1.0 <= t < 1.0 + lasts_s else []
        back_s = path_s if supervisor.mode is not Mode.LOWER else path_s - (t - 1.0)
        supervisor.update(t, findings, max(0.0, back_s), lowerable)
    return [event.reaction for event in supervisor.events], supervisor


@pytest.mark.parametrize("cause", WAITED_FOR)
def test_what_passes_is_waited_for_and_what_persists_lowers(cause):
    assert reactions(cause, 0.3)[0] == ["hold", "run"]
    assert reactions(cause, 1.0)[0] == ["hold", "lower", "end"]
    assert reactions(cause, 1.0, lowerable=False)[0] == ["hold", "stop"]


@pytest.mark.parametrize("cause", [Cause.MOTOR, Cause.OBJECT])
def test_what_cannot_be_held_any_more_is_let_go_at_once(cause):
    found, supervisor = reactions(cause, CHECK)
    assert found == ["stop"]
    assert supervisor.grip(0.99) == 1.0
    assert 0.0 < supervisor.grip(1.2) < 1.0
    assert supervisor.grip(1.5) == 0.0
    assert supervisor.stands


def test_a_dead_encoder_stops_with_full_grip_unless_it_comes_back():
    found, supervisor = reactions(Cause.ENCODER, 1.0)
    assert found == ["hold", "stop"]
    assert supervisor.grip(9.0) == 1.0
    assert not supervisor.stands
    assert reactions(Cause.ENCODER, CHECK)[0] == ["hold", "run"]


@pytest.mark.parametrize("cause", [Cause.JOINT, Cause.SATURATION])
def test_lowering_that_is_blocked_stops(cause):
    assert reactions(cause, 9.0, path_s=9.0)[0] == ["hold", "lower", "stop"]
    # The tilt may well be off for as long: it is why the object is lowered.
    assert reactions(Cause.TILT, 9.0, path_s=5.0)[0] == ["hold", "lower", "end"]


def test_holds_without_end_lower():
    supervisor = Supervisor(SETTINGS)
    for t in np.arange(0.0, 60.0, CHECK).tolist():
        findings = [Finding(Cause.SILENCE, "it")] if t % 1.0 < 0.2 else []
        supervisor.update(t, findings, 1.0, lowerable=True)
        if supervisor.mode is Mode.LOWER:
            break
    held = [event.reaction for event in supervisor.events]
    # Each lasts for 0.2 s of trouble and 0.2 s of quiet; the last is not waited for.
    assert held.count("hold") == pytest.approx(SETTINGS.holds_s / 0.4, abs=2.0)
    assert held[-1] == "lower"


def test_a_run_that_was_stopped_or_lowered_ends_a_second_later():
    _, supervisor = reactions(Cause.MOTOR, CHECK)
    assert supervisor.left_s(1.5, 2.0) == pytest.approx(0.5)
    lowering = Supervisor(SETTINGS)
    lowering.mode = Mode.LOWER
    assert lowering.left_s(1.5, 2.0) == pytest.approx(3.0)


def test_path_time_is_the_clock_s_to_the_last_bit_until_it_is_held():
    clock, t = PathClock(STEP), 0.0
    for _ in range(1000):
        assert clock.at(t, 1.0) == t
        t += STEP
    assert clock.at(t, 0.0) < t


@pytest.mark.parametrize("rate", [0.0, -1.0])
def test_path_time_slows_down_smoothly_and_never_leaves_the_path(rate):
    clock, times, rates = PathClock(STEP), [], []
    for i in range(3000):
        times.append(clock.at(1.0 + i * STEP, rate))
        rates.append(clock.rate)
    # From 1 to 0 in 0.2 s.
    assert np.abs(np.diff(rates)).max() <= 5.0 * STEP + 1e-12
    assert rates[-1] == rate
    assert times[-1] == (0.0 if rate < 0.0 else pytest.approx(1.1, abs=2e-3))
    assert min(times) >= 0.0
    assert math.isclose(max(times), 1.1, abs_tol=2e-3)
    # Half of the way back the object is where it was on the way there.
    back = [clock.at(4.0 + i * STEP, 1.0) for i in range(1000)]
    assert np.all(np.diff(back) >= 0.0) or rate < 0.0
    assert clock.rate == 1.0
