"""Sweeps as a whole: every episode once, whatever dies meanwhile, and identical replays."""

import json
import math
import os
import pickle
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import dask
import psutil
import pyarrow.parquet as pq
import pytest
from distributed import LocalCluster

from fulcrum.scenarios import scenarios
from fulcrum.scenarios.cli import main
from fulcrum.sim.motion.joint_path import PathError
from fulcrum.sim.plant.protocol import DivergedError
from fulcrum.sim.run.workers import Workers
from fulcrum.sim.sweep.design import Sweep
from fulcrum.sim.sweep.episode import run_episode
from fulcrum.sim.sweep.farm import LostEpisodesError, run_sweep
from fulcrum.sim.sweep.store import Store
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError
from tests.helpers.sweeps import ROOT, SCENE, short_sweep

# What depends on the machine and not on the run.
TIMES = ("wall_s", "cpu_s", "timing.wall_s", "timing.real_time_factor")
TIMES += ("synthesis.p50_us", "synthesis.p99_us")


def workers_of(process):
    """The processes that Dask started for a driver."""
    children = psutil.Process(process).children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def flat(content, prefix=""):
    """Nested dictionaries as one level of names with dots, as a sweep's columns are named."""
    found = {}
    for key, value in content.items():
        found |= (
            flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
        )
    return found


def fulcrum(*arguments):
    """`fulcrum` with a short scene, as the leader of processes of its own."""
    command = [sys.executable, "-m", "tests.helpers.sweeps", *arguments]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    return subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def parts_in(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("parts/*.parquet")}


def wait_for_parts(driver, folder, count):
    """Waits until so many episodes are finished, within reason."""
    end = time.monotonic() + 120.0
    while len(parts_in(folder)) < count:
        assert driver.poll() is None, driver.communicate()
        assert time.monotonic() < end
        time.sleep(0.005)


class Story(NamedTuple):
    """A sweep that is interrupted, killed, and finished though one of its workers is killed.

    Attributes:
        sweep: What it is.
        folder: Where it is.
        errors: What the interrupted command said.
        code: How it ended.
        kept: Names of the finished episodes, and when each was written, after every act.
        orphans: Processes that the killed driver left.
        worker: The worker that was killed.
        seen: Episodes done, in all, and failures, as reported in the last act.
        parts: Rows as they were found before the last act.
        rows: All rows.
    """

    sweep: Sweep
    folder: Path
    errors: str
    code: int
    kept: list[dict[str, int]]
    orphans: list[psutil.Process]
    worker: psutil.Process
    seen: list[tuple[int, int, int]]
    parts: dict[str, dict]
    rows: list[dict]


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    out = tmp_path_factory.mktemp("sweep") / "out"
    words = f"sweep {SCENE.name} --episodes 2 --preset lab --seed 5 --workers 1 --out {out}"
    words += " --controllers margin,paper --grid friction=1.0,0.5"
    driver = fulcrum(*words.split())
    wait_for_parts(driver, out, 1)
    os.killpg(driver.pid, signal.SIGINT)  # as Ctrl-C does it: to the workers too
    _, errors = driver.communicate(timeout=60)
    kept = [parts_in(out)]

    again = shlex.split(errors.partition("Resume with: ")[2])
    assert again[0] == "fulcrum", errors
    killed = fulcrum(*again[1:])
    wait_for_parts(killed, out, len(kept[0]) + 1)
    orphans = workers_of(killed.pid)
    killed.kill()
    killed.communicate(timeout=60)
    psutil.wait_procs(orphans, timeout=20)
    kept.append(parts_in(out))
    parts = {n: pq.ParquetFile(out / "parts" / n).read().to_pylist()[0] for n in kept[1]}

    workers, seen = [], []

    def progress(done, total, failures):
        seen.append((done, total, failures))
        if done == len(kept[1]) + 1 and not workers:
            workers.append(workers_of(os.getpid())[0])
            workers[0].kill()

    sweep = short_sweep(grid=(("friction", (1.0, 0.5)),))
    # A cluster that runs already; the first two acts had their own.
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as there:
        cluster = Workers(scheduler=there.scheduler_address)
        rows = run_sweep(sweep, out, cluster, progress).rows.to_pylist()
    return Story(
        sweep, out, errors, driver.returncode, kept, orphans, workers[0], seen, parts, rows
    )


def test_an_interrupted_sweep_says_in_one_line_how_to_go_on(story):
    assert story.code == 130
    assert len(story.errors.splitlines()) == 1
    kept = len(story.kept[0])
    assert 1 <= kept < 8
    assert f"{kept} episodes are kept, {8 - kept} are left" in story.errors


def test_what_was_finished_when_the_driver_was_killed_is_kept_as_it_was(story):
    interrupted, killed = story.kept
    assert len(interrupted) < len(killed) < 8
    assert interrupted.items() <= killed.items()
    final = {f"{row['episode']:07d}-{row['controller']}.parquet": row for row in story.rows}
    # Times too: none of them was run again.
    assert {name: final[name] for name in story.parts} == story.parts


def test_workers_end_with_a_driver_that_is_killed(story):
    assert len(story.orphans) == 1
    assert not story.orphans[0].is_running()


def test_every_episode_is_there_once_though_a_worker_died(story):
    assert not story.worker.is_running()
    sweep, rows = story.sweep, story.rows
    # Two seeds, two points of the grid, two controllers.
    assert len(rows) == len(sweep.all_episodes()) == 8
    asked = [(e.number, e.controller, e.seed) for e in sweep.all_episodes()]
    assert [(r["episode"], r["controller"], r["seed"]) for r in rows] == asked
    assert all(math.isfinite(row["tilt.final_deg"]) for row in rows)


def test_progress_counts_episodes_and_failures(story):
    assert [done for done, _, _ in story.seen] == list(range(len(story.kept[1]), 9))
    assert {total for _, total, _ in story.seen} == {8}
    assert story.seen[-1][2] == sum(not row["success"] for row in story.rows) > 0


def test_a_finished_sweep_is_one_file_and_not_run_again(story, monkeypatch, capsys):
    assert pq.read_table(story.folder / "episodes.parquet").to_pylist() == story.rows
    monkeypatch.setitem(scenarios(), SCENE.name, SCENE)
    arguments = shlex.split(story.errors.partition("Resume with: fulcrum ")[2])
    assert main(arguments) == 0
    names = {path.name for path in story.folder.iterdir()}
    assert names == {"config.json", "episodes.parquet", "sweep.json", "map.png"}
    assert pq.read_table(story.folder / "episodes.parquet").to_pylist() == story.rows
    summary = json.loads((story.folder / "sweep.json").read_text())
    assert [summary["controllers"][n]["episodes"] for n in ("margin", "paper")] == [4, 4]
    assert (story.folder / "map.png").read_bytes().startswith(b"\x89PNG")
    output = capsys.readouterr().out
    assert "margin" in output
    assert str(story.folder) in output


def test_all_controllers_meet_the_same_worlds(story):
    rows = story.rows
    worlds = {}
    for row in rows:
        truths = {name: value for name, value in row.items() if name.startswith("world.")}
        assert worlds.setdefault(row["episode"], truths) == truths
    assert len(worlds) == 4
    masses = {truths["world.mass"] for truths in worlds.values()}
    assert len(masses) == 2  # one per seed, at both points of the grid


def test_rows_hold_all_truths_of_the_world_and_all_figures_of_the_report(story):
    sweep, rows = story.sweep, story.rows
    names = {name.split(".")[1] for name in rows[0] if name.startswith("world.")}
    # What has no deviation at all has no columns.
    empty = {
        name for name, value in vars(sweep.world(sweep.all_episodes()[0])).items() if value == ()
    }
    assert set(vars(World())) - empty <= names
    assert [rows[0][f"world.friction.{name}"] for name in SCENE.contact_names] == [1.0] * 4
    assert all(f"contacts.{name}.slip_mm" in rows[0] for name in SCENE.contact_names)


def test_a_grid_s_value_decides_and_rows_say_what_a_failure_began_with(story):
    rows = story.rows
    margin = [row for row in rows if row["controller"] == "margin"]
    slippery = [row for row in margin if row["world.friction"] == 0.5]
    # Synthesis with 80 % of the friction holds where there is all of it, not where half is missing.
    assert [row["success"] for row in margin if row["world.friction"] == 1.0] == [True, True]
    assert [row["success"] for row in slippery] == [False, False]
    for row in slippery:
        assert row["category"] in ("slip", "lost", "tilt")
        assert row["cause"].startswith(row["category"])
        assert 0.0 < row["failed_at_s"] <= row["timing.sim_s"]


def test_the_command_of_a_row_replays_it_bit_for_bit(story, tmp_path, monkeypatch, capsys):
    rows = story.rows
    monkeypatch.setitem(scenarios(), SCENE.name, SCENE)
    row = next(r for r in rows if r["controller"] == "margin" and not r["success"])
    command = shlex.split(row["replay"])
    assert command[0] == "fulcrum"
    main([*command[1:], "--out", str(tmp_path / "replay")])
    report = flat(json.loads((tmp_path / "replay" / "report.json").read_text()))
    compared = {n: v for n, v in report.items() if n in row and n not in TIMES and n != "failures"}
    assert len(compared) > 40
    assert compared == {name: row[name] for name in compared}
    assert " ".join(failure["text"] for failure in report["failures"]) == row["failures"]
    assert report["failures"][0]["text"] in capsys.readouterr().out
    # Another seed is another run.
    other = next(r for r in rows if r["seed"] != row["seed"])
    assert compared != {name: other[name] for name in compared}


def verdict_of(row, folder):
    """Exit code of a row's replay, and its report."""
    code = main([*shlex.split(row["replay"])[1:], "--out", str(folder)])
    return code, json.loads((folder / "report.json").read_text())


def same_verdict(row, code, report):
    """Whether a replay has the verdict, causes and exit code of its episode."""
    failures = report["failures"]
    first = failures[0] if failures else {"t": None, "category": None, "subject": ""}
    cause = f"{first['category']} {first['subject']}".strip() if failures else None
    return (
        code == (0 if row["success"] else 1)
        and (report["verdict"] == "pass") is row["success"]
        and report["outcome"] == row["outcome"]
        and (cause, first["category"], first["t"])
        == (row["cause"], row["category"], row["failed_at_s"])
        and " ".join(failure["text"] for failure in failures) == row["failures"]
    )


def test_every_replay_has_the_verdict_causes_and_exit_code_of_its_row(
    story, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(scenarios(), SCENE.name, SCENE)
    assert {row["success"] for row in story.rows} == {True, False}
    for row in story.rows:
        folder = tmp_path / f"{row['episode']}-{row['controller']}"
        code, report = verdict_of(row, folder)
        assert same_verdict(row, code, report), row["replay"]
        # One verdict is printed, and it is that one.
        output = capsys.readouterr().out
        assert (f"{SCENE.name}: PASS" in output) is row["success"]
        assert (f"{SCENE.name}: FAIL" in output) is not row["success"]
        assert "success" not in output
        assert not same_verdict(row, 1 - code, report)


def test_an_episode_of_worlds_as_believed_is_replayed_with_a_sweep_s_tolerances(
    tmp_path, monkeypatch, capsys
):
    sweep = short_sweep(preset="nominal", controllers=("paper",), episodes=1)
    (episode,) = sweep.all_episodes()
    row = run_episode(pickle.dumps(sweep), episode)
    monkeypatch.setitem(scenarios(), SCENE.name, SCENE)
    assert same_verdict(row, *verdict_of(row, tmp_path / "replay"))
    # Without the option it is held to the scenario's own.
    strict = {**row, "replay": row["replay"].replace(" --disturbed", "")}
    assert not same_verdict(row, *verdict_of(strict, tmp_path / "strict"))


def test_what_is_refused_says_so_in_its_row(monkeypatch):
    sweep = short_sweep(controllers=("margin",), episodes=1)
    (episode,) = sweep.all_episodes()
    for error, found in (
        (PathError(0.1, 0.0, 0.01, ["out of reach"]), "refused"),
        (DivergedError(0.0), "diverged"),
        (ZeroDivisionError(), None),
    ):

        def fail(*_, error=error, **__):
            raise error

        monkeypatch.setattr("fulcrum.sim.sweep.episode.execute", fail)
        row = run_episode(pickle.dumps(sweep), episode)
        assert (row["outcome"], row["success"], row["cause"]) == (found, False, "error")


class Deadly(Sweep):
    """A sweep that ends every process that unpacks it."""

    def __reduce__(self):
        return os._exit, (1,)


def test_episodes_that_kill_their_workers_are_named_and_not_tried_for_ever(tmp_path):
    sweep = Deadly(**{**vars(short_sweep()), "controllers": ("margin",), "episodes": 1})
    store = Store(sweep, tmp_path / "out")
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        pytest.raises(LostEpisodesError, match="0000000-margin"),
    ):
        run_sweep(sweep, store.folder, Workers(1))
    assert len(store.missing()) == 1


def test_a_scheduler_that_is_none_is_refused_and_leaves_no_files(tmp_path):
    sweep = short_sweep(controllers=("margin",))
    with pytest.raises(InvalidInputError, match="address of a running Dask scheduler"):
        run_sweep(sweep, tmp_path / "out", Workers(scheduler="nowhere://at-all"))
    assert not (tmp_path / "out").exists()
