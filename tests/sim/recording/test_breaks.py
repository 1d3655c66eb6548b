"""Recordings of runs that were killed or interrupted stay readable."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.recording import readable
from tests.helpers.recordings import NANOSECOND, Content, verified

ROOT = Path(__file__).parents[3]
SCENARIO = scenario("box-tilt")
TOTAL_S = Schedule(SCENARIO).total_s
# What a kill may lose [s of the run], and the block that may be under way at the last report.
MAY_BE_LOST, BLOCK = 0.5, 0.1
# Tells on its standard output how many steps are made and handed to the recorder.
TELLING_RUN = """
import sys
from pathlib import Path
from scenarios import scenario
from fulcrum.sim.run.execute import Request, execute
box = scenario("box-tilt")
request = Request(box, "margin", box.control, out=Path(sys.argv[1]))
execute(request, lambda done, total: print(done, flush=True))
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Folder of a run that was killed after 1.5 s, and how far it had told to be [s]."""
    folder = tmp_path_factory.mktemp("killed")
    command = [sys.executable, "-c", TELLING_RUN, str(folder)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        told = next(line for line in process.stdout if int(line) >= 1500)
        process.kill()
        # What it said between the line that was read and its death.
        told = [told, *process.stdout.read().split()][-1]
    assert process.returncode == -signal.SIGKILL
    return folder, 1e-3 * int(told)


def content_of(path):
    """What a recording holds whose writer may have died within a message."""
    with readable(path) as whole:
        return Content(whole)


def gaps(content, reached):
    """What a killed run that had got to a time [s] lost of it, beyond what it may lose."""
    plots = {name: f"plots/{name}" for name in ("tilt", "slip", "torque")}
    times = {name: content.series(plot, "Scalars:scalars")[0] for name, plot in plots.items()}
    times["box"], _ = content.poses("box", "Transform3D:translation")
    times["forces"], _ = content.series("forces/measured", "Arrows3D:vectors")
    lost = set()
    for name, at in times.items():
        rate = 1000 if name in plots else 50
        even = np.abs(np.diff(at) - 1.0 / rate).max() < 2 * NANOSECOND
        if not (even and at[0] == 0.0 and at[-1] >= reached - MAY_BE_LOST):
            lost.add(name)
    return lost


def test_a_killed_run_leaves_all_but_the_last_half_second(killed):
    folder, reached = killed
    assert reached < TOTAL_S - 1.0
    content = content_of(folder / "run.rrd")
    assert gaps(content, reached) == set()
    # What it told is indeed how far it was.
    assert content.end() <= reached + BLOCK
    assert {"config", "verdict", "world/world/table"} <= content.entities
    assert content.text("verdict") == "The run has not ended."


def test_a_recording_that_lost_more_than_half_a_second_is_caught(killed):
    folder, reached = killed
    content = content_of(folder / "run.rrd")
    assert len(gaps(content, reached + MAY_BE_LOST + 2 * BLOCK)) == 5


def test_a_killed_run_leaves_no_report(killed):
    folder, _ = killed
    assert {path.name for path in folder.iterdir()} == {"run.rrd", "config.json"}
    assert not verified(folder / "run.rrd")


def recorded_s(path):
    """How far a recording that is being written has got [s]."""
    try:
        return content_of(path).end()
    except (OSError, ValueError, RuntimeError):  # nothing or no series in it yet
        return 0.0


def interrupted_run(folder, ready):
    """Exit code and output of a `fulcrum run` that gets Ctrl-C as soon as ready() holds."""
    command = [
        sys.executable,
        "-m",
        "fulcrum.scenarios.cli",
        "run",
        "box-tilt",
        "--out",
        str(folder),
    ]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while not ready():
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    return process.returncode, output, errors


@pytest.mark.parametrize("moment", ["while the recording is set up", "in the middle"])
def test_ctrl_c_leaves_a_whole_recording_and_a_report_that_says_interrupted(tmp_path, moment):
    recording, config = tmp_path / "run.rrd", tmp_path / "config.json"
    ready = {
        "while the recording is set up": config.exists,
        "in the middle": lambda: recorded_s(recording) > 1.0,
    }[moment]
    code, output, errors = interrupted_run(tmp_path, ready)
    assert code == 130
    assert "INTERRUPTED" in output
    assert errors == ""
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["verdict"] == "interrupted"
    assert report["outcome"] == "interrupted"
    (failure,) = report["failures"]
    assert failure["category"] == "interrupted"
    assert failure["text"].startswith("The run was interrupted at ")
    assert verified(recording)
    content = Content(recording)
    begun = [phase["name"] for phase in report["phases"]]
    assert [name for _, name in content.states("phase")] == begun
    assert begun == [phase.name for phase in SCENARIO.phases][: len(begun)]
    # The report counts steps, the last of which begins 1 ms before the end.
    assert content.end() == pytest.approx(report["timing"]["sim_s"] - 0.001, abs=2 * NANOSECOND)
    assert (report["timing"]["sim_s"] > 1.0) == (moment == "in the middle")
    assert report["timing"]["sim_s"] < TOTAL_S
    verdict = content.text("verdict")
    assert verdict.startswith("# box-tilt: INTERRUPTED\n")


def test_a_file_cut_anywhere_gives_its_whole_messages(killed, tmp_path):
    folder, _ = killed
    data = (folder / "run.rrd").read_bytes()
    with readable(folder / "run.rrd") as whole:
        size = whole.stat().st_size
    for lost in (1, 17, 1000, 100_000):
        cut = tmp_path / f"cut_{lost}.rrd"
        cut.write_bytes(data[: size - lost])
        with readable(cut) as path:
            kept = path.stat().st_size
            assert path.read_bytes() == data[:kept]
            assert Content(path).end() > 0.0
        assert kept < size - lost
        assert cut.stat().st_size == size - lost  # the file itself is left alone
    # What Rerun says of it without this help.
    with pytest.raises(Exception, match=r"exceeds file size"):
        Content(tmp_path / "cut_1.rrd")
