"""The phases follow each other without jumps and say what they ask for; bad ones are refused."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.scenario.phases import HOLD, LEAVE, REACH, STANDOFF, TILT, Phase, stretched
from fulcrum.synthesis import InvalidInputError

BOX = scenario("box-tilt")
# Two phases that tilt, one in between that rests, and one that takes tilt back.
PHASES = (
    Phase("touch", 0.3, tilt=0.0, gap=0.0, grip=0.0),
    Phase("grip", 0.7, tilt=0.0, gap=0.0, grip=1.0),
    Phase("half", 2.0, tilt=0.5, gap=0.0, grip=1.0),
    Phase("rest", 0.4, tilt=0.5, gap=0.0, grip=1.0),
    Phase("full", 5.0, tilt=1.0, gap=0.0, grip=1.0),
    Phase("back", 1.5, tilt=0.8, gap=0.0, grip=1.0),
    Phase("let go", 0.5, tilt=0.8, gap=0.0, grip=0.0),
    Phase("withdraw", 0.6, tilt=0.8, gap=0.05, grip=0.0),
)
ODD = replace(BOX, phases=PHASES, path=replace(BOX.path, angle_deg=80.0))
END = np.radians(80.0)
SCENES = {**scenarios(), "odd": ODD}

each_scene = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)


def gap(schedule, reference):
    """Distance of the hands from their contacts at a reference [m]."""
    before, phase = schedule.before(reference.phase), schedule.phases[reference.phase]
    return before.gap + (phase.gap - before.gap) * reference.progress


def asked(schedule, times):
    """Tilt [rad], gap [m] and grip at times, (k, 3)."""
    references = [schedule.at(float(t)) for t in times]
    return np.array([[r.tilt, gap(schedule, r), r.grip] for r in references])


# --- one phase after the other ---


@each_scene
def test_phases_lie_end_to_end(scene):
    schedule = Schedule(scene)
    assert schedule.starts[0] == 0.0
    # Sums of a few durations of seconds.
    np.testing.assert_allclose(schedule.starts[1:], schedule.ends[:-1], rtol=0, atol=1e-14)
    durations = [phase.duration_s for phase in scene.phases]
    np.testing.assert_allclose(schedule.ends - schedule.starts, durations, rtol=0, atol=1e-14)
    assert schedule.total_s == pytest.approx(sum(durations), abs=1e-13)
    assert schedule.end == pytest.approx(np.radians(scene.path.angle_deg), abs=1e-15)


@each_scene
def test_the_phase_is_that_of_the_time(scene):
    schedule = Schedule(scene)
    for index, (start, end) in enumerate(zip(schedule.starts, schedule.ends, strict=True)):
        inside = (start + 1e-9, (start + end) / 2.0, end - 1e-9)
        assert [schedule.at(float(t)).phase for t in inside] == [index] * 3
        if index:
            assert schedule.before(index) == scene.phases[index - 1]


@each_scene
def test_tilt_gap_and_grip_do_not_jump_where_one_phase_follows_another(scene):
    schedule, h = Schedule(scene), 1e-6
    # Profiles begin and end like 10 x^3: in 1 us of a phase of 0.3 s it is 4e-16, and its rate is
    # 30 x^2 / 0.3 s = 1e-9 / s; over these, rounding of tilts of 1 rad, 2e-16 / h.
    for border in schedule.ends[:-1]:
        around = asked(schedule, border + h * np.array([-2, -1, 1, 2]))
        assert np.abs(np.diff(around, axis=0)).max() < 1e-12
        assert np.abs(np.diff(around, axis=0) / h).max() < 1e-8
        for side in (-h, h):
            assert abs(schedule.at(border + side).rate) < 1e-8


def test_a_phase_that_begins_elsewhere_is_caught_as_a_jump():
    """The negative control: borders, when a phase is left out, do jump."""
    schedule = Schedule(ODD)
    ends = asked(schedule, schedule.ends - 1e-9)
    without = np.delete(ends, 2, axis=0)
    starts = asked(schedule, schedule.starts[3:] + 1e-9)
    assert np.abs(without[1, 0] - starts[0, 0]) > 0.5


@each_scene
def test_each_phase_ends_with_what_it_brings(scene):
    schedule = Schedule(scene)
    expected = [[p.tilt * schedule.end, p.gap, p.grip] for p in scene.phases]
    # A nanosecond before its end, of profiles that are flat there.
    np.testing.assert_allclose(asked(schedule, schedule.ends - 1e-9), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        asked(schedule, [0.0])[0], [0.0, scene.standoff, 0.0], rtol=0, atol=1e-15
    )


def test_half_way_through_a_phase_half_is_done():
    reference = Schedule(ODD).at(1.0 + 2.0 + 0.4 + 2.5)
    assert (reference.phase, reference.grip) == (4, 1.0)
    assert reference.progress == pytest.approx(0.5, abs=1e-14)
    assert reference.tilt == pytest.approx(0.75 * END, abs=1e-14)
    # Minimum jerk is fastest there: 15/8 of the mean.
    assert reference.rate == pytest.approx(1.875 / 5.0, abs=1e-14)
    grip = Schedule(ODD).at(0.3 + 0.35)
    assert grip.grip == pytest.approx(0.5, abs=1e-14)
    assert grip.tilt == 0.0


@each_scene
def test_before_the_start_and_after_the_end_everything_rests(scene):
    schedule = Schedule(scene)
    last = scene.phases[-1]
    for t in (schedule.total_s, schedule.total_s + 0.1, schedule.total_s + 1e3):
        reference = schedule.at(t)
        assert (reference.phase, reference.progress) == (len(scene.phases) - 1, 1.0)
        # The sum of the durations may be off by a rounding, where the profile is flat.
        assert reference.rate == pytest.approx(0.0, abs=1e-20)
        assert reference.grip == last.grip
        assert reference.tilt == pytest.approx(last.tilt * schedule.end, abs=1e-15)
    for t in (0.0, -1.0):
        reference = schedule.at(t)
        assert (reference.phase, reference.progress, reference.rate) == (0, 0.0, 0.0)
        assert (reference.tilt, reference.grip) == (0.0, 0.0)


@each_scene
def test_the_rate_is_the_derivative_of_the_progress(scene):
    schedule, h = Schedule(scene), 1e-5
    times = np.linspace(0.01, schedule.total_s - 0.01, 1000)
    times = times[np.abs(times[:, None] - schedule.ends).min(axis=1) > 1e-3]
    progress = [[schedule.at(float(t + d)).progress for t in times] for d in (-h, h)]
    slope = (np.array(progress[1]) - progress[0]) / (2.0 * h)
    rate = np.array([schedule.at(float(t)).rate for t in times])
    # Third derivative 60 / T^3 times h^2 / 6, in the shortest phase; rounding of 1 over 2 h, 1e-11.
    shortest = min(phase.duration_s for phase in scene.phases)
    bound = 1.1 * (10.0 * h**2 / shortest**3 + 2e-11)
    np.testing.assert_allclose(rate, slope, rtol=0, atol=bound)
    # A millisecond's delay is caught.
    late = np.array([schedule.at(float(t + 1e-3)).rate for t in times])
    assert np.abs(late - slope).max() > 1e-4


@each_scene
def test_times_invert_the_progress(scene):
    schedule, progress = Schedule(scene), np.linspace(0.0, 1.0, 200)
    for index, phase in enumerate(scene.phases):
        times = schedule.times(index, progress)
        assert (np.diff(times) > 0.0).all()
        assert times[0] == 0.0
        assert times[-1] == pytest.approx(phase.duration_s, rel=1e-14)
        found = [schedule.at(float(schedule.starts[index] + t)).progress for t in times[1:-1]]
        # Linear interpolation over 1e-4 of the phase: its square / 8 times the largest second
        # derivative of the profile, 5.77.
        bound = 5.8 * 1e-8 / 8.0
        np.testing.assert_allclose(found, progress[1:-1], rtol=0, atol=bound)
        # A thousandth of the phase too late is caught.
        late = schedule.starts[index] + times[100] + 1e-3 * phase.duration_s
        assert abs(schedule.at(float(late)).progress - progress[100]) > 100.0 * bound


# --- held and free ---


def test_phases_with_full_grip_from_start_to_end_are_held_and_those_without_any_are_free():
    schedule = Schedule(ODD)
    assert schedule.held.tolist() == [False, False, True, True, True, True, False, False]
    assert schedule.free.tolist() == [True, False, False, False, False, False, False, True]


@each_scene
def test_held_is_where_grip_is_full_and_free_where_there_is_none_at_all_times(scene):
    schedule = Schedule(scene)
    for index, (start, end) in enumerate(zip(schedule.starts, schedule.ends, strict=True)):
        grips = asked(schedule, np.linspace(start + 1e-6, end - 1e-6, 50))[:, 2]
        assert schedule.held[index] == (grips == 1.0).all()
        assert schedule.free[index] == (grips == 0.0).all()
    assert schedule.held.any()


def test_half_a_grip_is_neither_held_nor_free():
    half = [replace(p, grip=0.5 * p.grip) for p in PHASES]
    schedule = Schedule(replace(ODD, phases=tuple(half)))
    assert not schedule.held.any()
    assert schedule.free.tolist() == [True, *[False] * 6, True]


# --- stretched ---


def test_stretching_changes_the_phases_that_tilt_and_no_others():
    phases = stretched(PHASES, 3.3)
    for old, new in zip(PHASES, phases, strict=True):
        tilts = old.name in ("half", "full", "back")
        assert new == (replace(old, duration_s=3.3) if tilts else old)


@pytest.mark.parametrize("name", scenarios())
def test_stretching_leaves_a_scenario_s_other_phases(name):
    scene = scenario(name)
    phases = stretched(scene.phases, 11.0)
    changed = [p.name for p, q in zip(scene.phases, phases, strict=True) if p != q]
    assert changed
    assert changed == [p.name for p in TILT]


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, 600.1])
def test_a_senseless_stretch_is_refused_by_name(value):
    with pytest.raises(InvalidInputError, match=rf"^phase tilt\.duration_s: got {value}; valid is"):
        stretched((*REACH, *TILT), value)


# --- phases that are refused ---


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("duration_s", value) for value in (0.0, -1.0, np.nan, np.inf, 600.001)),
        *(("tilt", value) for value in (-0.1, 1.1, np.nan)),
        *(("grip", value) for value in (-0.1, 1.1, np.nan)),
        *(("gap", value) for value in (-1e-3, np.nan, np.inf)),
    ],
)
def test_a_senseless_phase_is_refused_by_name(field, value):
    phase = Phase("lift", 1.0, tilt=0.5, gap=0.0, grip=0.0)
    with pytest.raises(InvalidInputError, match=rf"^phase lift\.{field}: got {value}; valid is"):
        replace(phase, **{field: value})


def test_grip_across_a_gap_is_refused_by_name():
    with pytest.raises(InvalidInputError, match=r"^phase reach\.grip: got 0\.1; valid is 0 while"):
        Phase("reach", 1.0, tilt=0.0, gap=0.01, grip=0.1)
    Phase("reach", 1.0, tilt=0.0, gap=0.01, grip=0.0)
    Phase("reach", 1.0, tilt=0.0, gap=0.0, grip=0.1)


def test_phases_at_the_ends_of_their_ranges_are_accepted():
    Phase("a", 600.0, tilt=1.0, gap=0.0, grip=1.0)
    Phase("b", 1e-3, tilt=0.0, gap=1.0, grip=0.0)


def test_the_usual_phases_reach_grip_tilt_and_leave_as_they_say():
    for leaving in (HOLD, LEAVE):
        schedule = Schedule(replace(BOX, phases=(*REACH, *TILT, *leaving)))
        # Hands come 5 mm near, touch, and grip before anything tilts.
        assert [p.gap for p in schedule.phases[:3]] == [0.005, 0.0, 0.0]
        assert schedule.held.tolist()[:5] == [False, False, False, True, True]
    assert schedule.phases[-1].gap == STANDOFF
    assert schedule.held.tolist()[5:] == [False, False, False]
    assert schedule.free.tolist() == [True, True, *[False] * 4, True, True]
