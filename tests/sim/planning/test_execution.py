"""A planned tilt in closed loop: the bars, what they rest on, and what is planned anew."""

import json
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.scenarios.cli import main
from fulcrum.scenarios.functions import chosen_planning
from fulcrum.sim.planning.execution import Planning, planned_tilt
from fulcrum.sim.scenario.phases import Phase
from fulcrum.sim.sweep.design import Sweep
from fulcrum.sim.sweep.episode import run_episode
from fulcrum.sim.world.faults import Fault, FaultKind
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.path.problem import PathObjective
from tests.helpers.executions import broken, executed, executed_as, execution, longest
from tests.helpers.plans import BOX, CYLINDER, fastest
from tests.helpers.recordings import Content
from tests.helpers.runs import rows_of

TICK = 0.001


# --- the bars


@pytest.mark.parametrize(("name", "stretch"), [(BOX, 1.0), (CYLINDER, 1.2)])
def test_a_planned_tilt_is_executed_within_the_bars(name, stretch):
    result = executed(name, stretch)
    assert broken(name, result) == set()
    assert result.report.verdict == "pass"
    assert result.report.events == ()
    lasted = np.count_nonzero(rows_of(name, result.trace, "tilt")) * TICK
    # Phases begin at ticks.
    assert lasted == pytest.approx(stretch * fastest(name).duration, abs=2 * TICK)
    moving = rows_of(name, result.trace, "tilt")
    pressed = result.trace.w_commanded_C[moving, : len(scenario(name).hands), N]
    # Contacts are made once for every half degree, over which the grip may change.
    off = np.radians(np.linspace(-0.5, 0.5, 21)[:, None]) + result.trace.tilt_ref[moving]
    planned = execution(name, stretch).grip.at(off.ravel()).reshape(21, *pressed.shape)
    assert (pressed >= planned.min(axis=0) - 0.05).all()


def test_without_inertia_the_same_timing_breaks_them():
    quasi_static = executed(BOX, 1.0, inertia=False)
    assert broken(BOX, quasi_static) != set()
    assert quasi_static.report.verdict == "fail"
    counted = executed(BOX, 1.0)
    worst = [np.abs(r.trace.tilt - r.trace.tilt_ref).max() for r in (quasi_static, counted)]
    assert worst[0] > 2.0 * worst[1]


def test_the_longest_cut_is_found():
    flags = np.array([[0, 1], [1, 1], [1, 0], [1, 1], [0, 1]], float)
    assert (longest(flags), longest(0.0 * flags)) == (3, 0)


def test_a_torque_may_be_cut_for_as_long_as_the_tolerances_say():
    result = executed(BOX, 1.0)
    scene = execution(BOX, 1.0).scenario
    assert scene.tolerances.saturated_s == 0.02
    assert 0 < longest(result.trace.saturated) <= 20
    assert "cut" not in " ".join(result.report.sentences)


def test_a_robust_plan_bears_a_world_in_which_the_box_slips_without():
    # Three quarters of the set that the plan serves: on its edge friction is used up.
    world = World(mass=1.15, center_of_mass=(0.015, 0.0, -0.015), friction=(0.85,) * 4)
    assert broken(BOX, executed_as(BOX, Planning(points=30, robust=True), world)) == set()
    assert "slip" in broken(BOX, executed(BOX, 1.0, world))


def test_a_plan_for_another_objective_is_executed_too():
    planning = Planning(points=30, objective=PathObjective.FRICTION_MARGIN, duration=1.6)
    result = executed_as(BOX, planning)
    assert broken(BOX, result) == set()
    lasted = np.count_nonzero(rows_of(BOX, result.trace, "tilt")) * TICK
    assert 1.2 * fastest(BOX).duration < lasted <= 1.6 + 2 * TICK


def test_the_options_of_a_planning_make_it():
    chosen = scenario(BOX)
    asked = Planning(1.5, objective=PathObjective.LEAST_EFFORT, duration=3.0, robust=True)
    assert asked.options == "--plan least-effort --stretch 1.5 --duration 3.0 --robust"
    assert chosen_planning(chosen, "least-effort", 1.5, 3.0, True) == asked
    assert chosen_planning(chosen, "least-effort", 1.0, None, False).duration == 8.0
    assert math.isinf(chosen_planning(chosen, "least-time", 1.0, None, False).duration)
    assert chosen_planning(chosen, None, 1.0, 3.0, False) is None


# --- held


def test_a_held_tilt_goes_on_from_rest_by_the_same_plan():
    planned = execution(BOX, 1.0)
    names = [phase.name for phase in planned.scenario.phases]
    start = float(planned.joint_path.schedule.starts[names.index("tilt")])
    silence = Fault(FaultKind.SILENCE, start + 0.5, duration_s=0.1)
    result = executed(BOX, 1.0, World(faults=(silence,)))
    assert [e.reaction for e in result.report.events] == ["hold", "run"]
    assert broken(BOX, result) == set()
    again = result.report.events[-1].t
    trace = result.trace
    after = (trace.t > again) & rows_of(BOX, trace, "tilt")
    # From rest, up to the plan's rate, and without a jump of the tilt.
    assert abs(trace.rate_ref[after][0]) < 0.05
    assert np.diff(trace.tilt_ref).max() < 1.01 * TICK * trace.rate_ref.max()
    assert trace.rate_ref[after].max() > 1.0


def test_a_manoeuvre_in_two_tilts_is_refused():
    chosen = scenario(BOX)
    index = [phase.name for phase in chosen.phases].index("tilt")
    half = Phase("half", 4.0, tilt=0.5, gap=0.0, grip=1.0)
    phases = (*chosen.phases[:index], half, *chosen.phases[index:])
    with pytest.raises(InvalidInputError, match="half"):
        planned_tilt(replace(chosen, phases=phases), Planning())


# --- commands and records


def test_run_executes_a_plan_and_records_it_beside_what_was_measured(tmp_path, capsys):
    arguments = ["--plan", "least-time", "--stretch", "1.5", "--out", str(tmp_path / "run")]
    assert main(["run", CYLINDER, *arguments]) == 0
    assert capsys.readouterr().out.startswith(
        "cylinder-tilt: PASS\nOutcome: completed. Controller dynamic,"
    )
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    assert config["planning"]["stretch"] == 1.5
    content, plan = Content(tmp_path / "run" / "run.rrd"), execution(CYLINDER, 1.5).plan
    _, tilt = content.series("plots/tilt", "Scalars:scalars")
    times, forces = content.series("plots/normal_force/planned", "Scalars:scalars")
    _, torques = content.series("plots/torque/planned", "Scalars:scalars")
    _, rates = content.series("plots/tilt_rate", "Scalars:scalars")
    rows = np.round(times / TICK).astype(int)
    along = plan.along(np.radians(tilt[rows, 0]))
    np.testing.assert_allclose(forces, along.w_OC_C[..., N], rtol=1e-9)
    assert torques.shape == along.tau.shape
    assert np.abs(torques).max() == pytest.approx(0.9, rel=1e-4)  # shares of the limits
    # The plan's rates are the references', but that those are exact within an interval.
    np.testing.assert_allclose(np.degrees(along.rate), rates[rows, 0], rtol=0, atol=1e-3)
    assert np.abs(rates[:, 1] - rates[:, 0]).max() < 0.2 * rates[:, 0].max()


def test_a_plan_over_the_tilt_is_the_plan_over_time():
    planned = fastest(BOX)
    moments = [planned.at(t) for t in np.linspace(0.01, 0.99, 23) * planned.duration]
    along = planned.along(np.array([m.tilt for m in moments]))
    np.testing.assert_allclose(along.rate, [m.rate for m in moments], rtol=1e-9)
    np.testing.assert_allclose(along.w_OC_C, [m.w_OC_C for m in moments], rtol=0, atol=1e-9)
    np.testing.assert_allclose(along.tau, [m.tau for m in moments], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (["--plan", "most-time"], "least-time"),
        (["--stretch", "2"], "--stretch: got 2.0; valid is left out without a plan"),
        (["--robust"], "--robust: got True; valid is left out without a plan"),
        (["--plan", "least-time", "--stretch", "0"], "stretch"),
        (["--plan", "least-effort", "--duration", "0"], "duration"),
    ],
)
def test_bad_options_are_refused_in_one_line(tmp_path, capsys, wrong, named):
    assert main(["run", BOX, *wrong, "--out", str(tmp_path / "run")]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert named in message


@pytest.mark.parametrize("command", [["run"], ["sweep", "--episodes", "1"]])
def test_where_there_is_no_plan_one_sentence_says_why(tmp_path, capsys, command):
    out = ["--plan", "least-time", "--out", str(tmp_path / "out")]
    assert main([command[0], "box-lift", *command[1:], *out]) == 1
    assert capsys.readouterr().out.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_episode_of_a_sweep_executes_the_plan_and_its_replay_says_so():
    planned = execution(CYLINDER, 1.2)
    sweep = Sweep(
        planned.scenario, ("dynamic",), "nominal", episodes=1, seed=0, planning=Planning(1.2)
    )
    (episode,) = sweep.all_episodes()
    assert sweep.replay(episode) == (
        "fulcrum run cylinder-tilt --controller dynamic --preset nominal --seed 0 "
        "--plan least-time --stretch 1.2 --disturbed"
    )
    row = run_episode(pickle.dumps(sweep), episode)
    assert row["success"]
    # A world of the nominal preset deviates in nothing from what the other tests run.
    assert row["tilt.max_error_deg"] == executed(CYLINDER, 1.2).report.tilt.max_error_deg
    assert row["tilt.max_error_deg"] != executed(BOX, 1.0).report.tilt.max_error_deg
