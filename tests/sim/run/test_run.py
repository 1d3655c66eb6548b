"""A run's folder: configuration, report and recording, complete or not there at all."""

import json
import os
import signal
from dataclasses import asdict, replace
from importlib.metadata import version

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.scenarios.cli import main
from fulcrum.sim.evaluation.failure import Category, Failure
from fulcrum.sim.evaluation.outcome import Outcome
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.motion.joint_path import PathError
from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.plant.protocol import DivergedError
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.run.execute import Request, execute, resolved_config
from fulcrum.sim.scenario.phases import stretched
from fulcrum.synthesis.render import to_markdown
from tests.helpers.short_run import short_tilt

LET_GO = Failure(1.0, Category.LOST, "left", "Contact left let go.")
BLOCK = 250  # steps that the loop hands over at a time
# It passes: 1.9 s of simulated time.
SCENARIO = short_tilt(5.0, 1.2)
# 90 deg in 50 ms ask for 34 rad/s of hands on arms of 1.5 rad/s.
TOO_FAST = replace(SCENARIO, phases=stretched(scenario("box-tilt").phases, 0.05))


def request(**options):
    return Request(SCENARIO, "margin", SCENARIO.control, **options)


def strict_json(path):
    """The content of a JSON file; NaN and infinities, which are no JSON, are refused."""

    def refuse(constant):
        raise ValueError(f"{constant} in {path}")

    return json.loads(path.read_text(), parse_constant=refuse)


def plain(value):
    """Dataclass contents as JSON holds them: lists for tuples, null for infinite limits."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return None if value == float("inf") else value


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("run") / "new" / "out"


@pytest.fixture(scope="module")
def progress():
    return []


@pytest.fixture(scope="module")
def result(folder, progress):
    return execute(request(seed=4, out=folder), lambda *steps: progress.append(steps))


def test_a_run_leaves_recording_configuration_and_report(result, folder):
    assert result.report.verdict is Verdict.PASS
    assert {path.name for path in folder.iterdir()} == {"run.rrd", "config.json", "report.json"}


def test_the_configuration_is_the_resolved_scenario(result, folder):
    config = strict_json(folder / "config.json")
    assert config["scenario"] == plain(asdict(SCENARIO))
    assert config["scenario"]["phases"] == [asdict(phase) for phase in SCENARIO.phases]
    assert config["scenario"]["standoff"] == 0.002
    assert config["scenario"]["path"]["angle_deg"] == 5.0
    assert config["control"] == plain(asdict(SCENARIO.control))
    assert (config["controller"], config["seed"]) == ("margin", 4)


def test_the_configuration_names_the_installed_versions(result, folder):
    versions = strict_json(folder / "config.json")["versions"]
    assert versions == {name: version(name) for name in versions}
    assert {"mujoco", "pin", "clarabel", "rerun-sdk", "mink", "dm-control"} <= set(versions)


def test_infinite_limits_are_null_in_the_configuration(result, folder):
    hands = strict_json(folder / "config.json")["scenario"]["hands"]
    assert [hand["f_n_max"] for hand in hands] == [None, None]
    limited = replace(SCENARIO.hands[0], f_n_max=50.0)
    scene = replace(SCENARIO, hands=(limited, *SCENARIO.hands[1:]))
    config = resolved_config(replace(request(), scenario=scene))
    assert config["scenario"]["hands"][0]["f_n_max"] == 50.0


def test_a_file_with_an_infinite_number_is_no_strict_json(tmp_path):
    (tmp_path / "bad.json").write_text(json.dumps({"x": float("inf")}))
    with pytest.raises(ValueError, match="Infinity"):
        strict_json(tmp_path / "bad.json")


def test_the_written_report_is_the_returned_one(result, folder):
    written = strict_json(folder / "report.json")
    assert written == plain(asdict(result.report))
    assert written["seed"] == 4
    assert written["recording"] == "run.rrd"
    assert (folder / written["recording"]).stat().st_size > 0


def test_progress_counts_up_to_all_steps(result, progress):
    assert progress[-1] == (1900, 1900)
    assert [done for done, _ in progress] == [*range(BLOCK, 1900, BLOCK), 1900]


def test_the_text_of_the_verdict_holds_verdict_contacts_and_failures(result):
    report = replace(result.report, verdict=Verdict.FAIL, failures=(LET_GO,))
    text = to_markdown(report.page())
    assert text.startswith("# box-tilt: FAIL\n")
    assert "- Contact left let go." in text
    for name, contact in report.contacts.items():
        assert f"| {name} | 100.0 | 0 | {contact.slip_mm:.3f} |" in text


def test_without_a_folder_nothing_is_written_and_the_run_is_the_same(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    silent = execute(request(seed=4))
    assert list(tmp_path.iterdir()) == []
    assert silent.report.recording is None
    assert silent.trace.tau.tobytes() == result.trace.tau.tobytes()
    assert silent.report.contacts == result.report.contacts


def test_a_path_that_the_arms_cannot_follow_is_refused_before_anything_is_written(tmp_path):
    out = tmp_path / "out"
    with pytest.raises(PathError, match="at its speed limit"):
        execute(Request(TOO_FAST, "margin", TOO_FAST.control, out=out))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_after_the_present_block_with_a_complete_record(tmp_path, number):
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]

    def stop(done, total):
        if done == 2 * BLOCK:
            os.kill(os.getpid(), number)

    interrupted = execute(request(out=tmp_path), stop)
    assert interrupted.report.verdict is Verdict.INTERRUPTED
    assert interrupted.report.outcome is Outcome.INTERRUPTED
    # The signal arrives at once, or while the block that follows is made.
    steps = len(interrupted.trace)
    assert steps in (2 * BLOCK, 3 * BLOCK)
    when = f"{1e-3 * steps:.2f} s"
    assert interrupted.report.sentences == (f"The run was interrupted at {when}.",)
    assert strict_json(tmp_path / "report.json")["verdict"] == "interrupted"
    # Ctrl-C works as before once the run is over.
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)] == before


# --- divergence ---


def blow_up(monkeypatch, step):
    """Makes the plant's state run away in a step, counted from 0."""
    steps, made = [], MujocoPlant.step

    def stepped(plant):
        if len(steps) == step:
            plant.physics.data.joint("box").qvel[:] = 1e12
        steps.append(plant.measure().t)
        made(plant)

    monkeypatch.setattr(MujocoPlant, "step", stepped)


@pytest.mark.parametrize("step", [BLOCK, BLOCK + 50, 2 * BLOCK - 1, 1])
def test_a_diverged_run_keeps_every_step_before_and_says_when(monkeypatch, tmp_path, result, step):
    blow_up(monkeypatch, step)
    diverged = execute(request(seed=4, out=tmp_path))
    report = diverged.report
    assert report.verdict is Verdict.FAIL
    # It stands before the tilt that was not reached because of it.
    (error,) = [failure for failure in report.failures if failure.category == "error"]
    later = report.failures[report.failures.index(error) + 1 :]
    assert {failure.category for failure in later} <= {"tilt"}
    assert report.outcome is Outcome.DIVERGED
    assert error.text == (
        f"the simulation diverged at {1e-3 * step:.3f} s; check the scenario's physics."
    )
    # The blocks before, and of the last one what had been done.
    assert len(diverged.trace) == len(diverged.history.kept) == step
    np.testing.assert_array_equal(diverged.trace.tau, result.trace.tau[:step])
    np.testing.assert_array_equal(diverged.trace.tilt, result.trace.tilt[:step])
    assert strict_json(tmp_path / "report.json")["verdict"] == "fail"
    assert report.timing.sim_s == pytest.approx(1e-3 * step, abs=1e-12)


def test_the_loop_raises_only_after_it_has_handed_over_the_last_rows(monkeypatch):
    blow_up(monkeypatch, 2 * BLOCK + 50)
    loop, blocks = closed_loop(SCENARIO, SCENARIO.control), []
    with pytest.raises(DivergedError, match=r"diverged at 0\.550 s"):
        for block in loop.run():
            blocks.append(len(block))
    assert blocks == [BLOCK, BLOCK, 50]
    assert loop.steps == 2 * BLOCK + 50


def test_a_run_that_does_not_run_away_does_not_diverge(monkeypatch):
    blow_up(monkeypatch, -1)
    assert execute(request()).report.verdict is Verdict.PASS


def test_divergence_in_the_first_step_is_one_sentence_and_code_2(monkeypatch, tmp_path, capsys):
    blow_up(monkeypatch, 0)
    with pytest.raises(DivergedError):
        execute(request())
    monkeypatch.undo()
    blow_up(monkeypatch, 0)
    assert main(["run", "box-tilt", "--out", str(tmp_path / "out")]) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors == (
        "fulcrum: the simulation diverged at 0.000 s; check the scenario's physics.\n"
    )
    assert not (tmp_path / "out" / "report.json").exists()
