"""Sweeps as a whole: every episode once, whatever dies meanwhile, and identical replays."""

import json
import math
import os
import shlex
import signal
import subprocess
import sys
import time

import dask
import psutil
import pyarrow.parquet as pq
import pytest

from scenarios import scenarios
from scenarios.cli import main
from sim.sweep import LostEpisodesError, Store, Sweep, Workers, run_sweep
from sim.world import World
from synthesis import InvalidInputError
from tests.sweeps import ROOT, SCENE, short_sweep

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


def without_times(row):
    return {name: value for name, value in row.items() if name not in TIMES}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A sweep on two workers of which one is killed when the first episode is finished."""
    folder = tmp_path_factory.mktemp("sweep") / "out"
    sweep = short_sweep(grid=(("friction", (1.0, 0.5)),))
    killed, seen = [], []

    def progress(done, total, failures):
        seen.append((done, total, failures))
        if done == 1 and not killed:
            killed.append(workers_of(os.getpid())[0])
            killed[0].kill()

    rows = run_sweep(sweep, Store(sweep, folder), Workers(2), progress).to_pylist()
    assert killed
    assert not killed[0].is_running() or killed[0].status() == psutil.STATUS_ZOMBIE
    return sweep, folder, rows, seen


def test_every_episode_is_there_once_though_a_worker_died(finished):
    sweep, _, rows, _ = finished
    # Two seeds, two points of the grid, two controllers.
    assert len(rows) == len(sweep.all_episodes()) == 8
    asked = [(e.number, e.controller, e.seed) for e in sweep.all_episodes()]
    assert [(r["episode"], r["controller"], r["seed"]) for r in rows] == asked
    assert all(math.isfinite(row["tilt.final_deg"]) for row in rows)


def test_progress_counts_episodes_and_failures(finished):
    _, _, rows, seen = finished
    assert [done for done, _, _ in seen] == list(range(9))
    assert {total for _, total, _ in seen} == {8}
    assert seen[-1][2] == sum(not row["success"] for row in rows) > 0


def test_a_finished_sweep_is_one_file_and_not_run_again(finished):
    sweep, folder, rows, _ = finished
    assert {path.name for path in folder.iterdir()} == {"config.json", "episodes.parquet"}
    assert pq.read_table(folder / "episodes.parquet").to_pylist() == rows
    started = time.perf_counter()
    again = run_sweep(sweep, Store(sweep, folder), Workers(2)).to_pylist()
    assert again == rows
    # No process starts in so short a time; one episode takes as long.
    assert time.perf_counter() - started < 0.3


def test_all_controllers_meet_the_same_worlds(finished):
    _, _, rows, _ = finished
    worlds = {}
    for row in rows:
        truths = {name: value for name, value in row.items() if name.startswith("world.")}
        assert worlds.setdefault(row["episode"], truths) == truths
    assert len(worlds) == 4
    masses = {truths["world.mass"] for truths in worlds.values()}
    assert len(masses) == 2  # one per seed, at both points of the grid


def test_rows_hold_all_truths_of_the_world_and_all_figures_of_the_report(finished, tmp_path):
    sweep, _, rows, _ = finished
    names = {name.split(".")[1] for name in rows[0] if name.startswith("world.")}
    # What has no deviation at all has no columns.
    empty = {
        name for name, value in vars(sweep.world(sweep.all_episodes()[0])).items() if value == ()
    }
    assert set(vars(World())) - empty <= names
    assert [rows[0][f"world.friction.{name}"] for name in SCENE.contact_names] == [1.0] * 4
    assert all(f"contacts.{name}.slip_mm" in rows[0] for name in SCENE.contact_names)


def test_a_grid_s_value_decides_and_rows_say_what_a_failure_began_with(finished):
    _, _, rows, _ = finished
    margin = [row for row in rows if row["controller"] == "margin"]
    slippery = [row for row in margin if row["world.friction"] == 0.5]
    # Synthesis with 80 % of the friction holds where there is all of it, not where half is missing.
    assert [row["success"] for row in margin if row["world.friction"] == 1.0] == [True, True]
    assert [row["success"] for row in slippery] == [False, False]
    for row in slippery:
        assert row["category"] in ("slip", "lost", "tilt")
        assert row["cause"].startswith(row["category"])
        assert 0.0 < row["failed_at_s"] <= row["timing.sim_s"]


def test_the_command_of_a_row_replays_it_bit_for_bit(finished, tmp_path, monkeypatch, capsys):
    _, _, rows, _ = finished
    monkeypatch.setitem(scenarios(), SCENE.name, SCENE)
    row = next(r for r in rows if r["controller"] == "margin" and not r["success"])
    command = shlex.split(row["replay"])
    assert command[0] == "fulcrum"
    main([*command[1:], "--out", str(tmp_path / "replay")])
    report = flat(json.loads((tmp_path / "replay" / "report.json").read_text()))
    compared = {n: v for n, v in report.items() if n in row and n not in TIMES and n != "failures"}
    assert len(compared) > 40
    assert compared == {name: row[name] for name in compared}
    assert " ".join(report["failures"]) == row["failures"]
    assert row["cause"] in capsys.readouterr().out
    # Another seed is another run.
    other = next(r for r in rows if r["seed"] != row["seed"])
    assert compared != {name: other[name] for name in compared}


def fulcrum(*arguments):
    """`fulcrum` with a short scene, as the leader of processes of its own."""
    command = [sys.executable, "-m", "tests.sweeps", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
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


def test_an_interrupted_and_a_killed_sweep_go_on_where_they_stopped(tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    words = f"sweep {SCENE.name} --episodes 4 --preset lab --controllers margin,paper --workers 2"
    driver = fulcrum(*words.split(), "--out", str(out))
    wait_for_parts(driver, out, 2)
    os.killpg(driver.pid, signal.SIGINT)  # as Ctrl-C does it: to the workers too
    _, errors = driver.communicate(timeout=60)
    assert driver.returncode == 130
    assert len(errors.splitlines()) == 1
    first = parts_in(out)
    assert f"{len(first)} episodes are kept, {8 - len(first)} are left" in errors
    assert 2 <= len(first) < 8

    again = shlex.split(errors.partition("Go on with: ")[2])
    assert again[0] == "fulcrum"
    driver = fulcrum(*again[1:])
    wait_for_parts(driver, out, len(first) + 1)
    orphans = workers_of(driver.pid)
    driver.kill()
    driver.communicate(timeout=60)
    second = parts_in(out)
    assert len(orphans) == 2
    psutil.wait_procs(orphans, timeout=20)
    assert not any(orphan.is_running() for orphan in orphans)
    # What was finished has not been touched, let alone lost.
    assert len(second) > len(first)
    assert first.items() <= second.items()

    kept = {
        name: pq.ParquetFile(out / "parts" / name).read().to_pylist()[0] for name in sorted(second)
    }
    monkeypatch.setitem(scenarios(), SCENE.name, SCENE)
    assert main(again[1:]) == 0
    rows = pq.read_table(out / "episodes.parquet").to_pylist()
    names = [f"{row['episode']:07d}-{row['controller']}.parquet" for row in rows]
    assert len(names) == len(set(names)) == 8
    assert {n: r for n, r in zip(names, rows, strict=True) if n in kept} == kept
    summary = json.loads((out / "sweep.json").read_text())
    assert summary["session"]["episodes"] == 8 - len(second)
    assert [summary["controllers"][n]["episodes"] for n in ("margin", "paper")] == [4, 4]
    assert (out / "map.png").read_bytes().startswith(b"\x89PNG")
    output = capsys.readouterr().out
    assert "margin" in output
    assert str(out) in output


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
        run_sweep(sweep, store, Workers(1))
    assert len(store.missing()) == 1


def test_a_scheduler_that_is_none_is_refused_and_leaves_no_files(tmp_path):
    sweep = short_sweep(controllers=("margin",))
    with pytest.raises(InvalidInputError, match="address of a running Dask scheduler"):
        run_sweep(sweep, Store(sweep, tmp_path / "out"), Workers(scheduler="nowhere://at-all"))
    assert not (tmp_path / "out").exists()
