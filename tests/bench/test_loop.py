"""The closed loop: how much faster than real time, where the time goes, memory and start-up."""

import contextlib
import os
import subprocess
import sys
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.control.controller import ForceController
from fulcrum.sim.evaluation.monitor import Monitor
from fulcrum.sim.model.robot_model import RobotModel, RobotState
from fulcrum.sim.model.statics import Statics
from fulcrum.sim.plant.mujoco import MujocoPlant
from fulcrum.sim.recording import Recorder
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.run.loop import ClosedLoop
from fulcrum.synthesis import Synthesizer

LOOP = "closed loop of box-tilt, recording on"
START = "start-up and memory"
RATES = (100, 250, 500, 1000)
# Which calls belong to which part; time counts for the innermost.
PARTS = {
    "physics": [(MujocoPlant, "step")],
    "model": [
        (RobotModel, "at"),
        (RobotState, "mass_matrix"),
        (RobotState, "contact_jacobians"),
    ],
    "solve": [(Synthesizer, "solve")],
    "assembly": [(Statics, "problem")],
    "control": [(ForceController, "command")],
    "monitor": [(Monitor, "update")],
    "recording": [(Recorder, "write"), (Recorder, "close")],
    "loop": [(ClosedLoop, "_step")],
}
FIRST_STEP = """
from pathlib import Path
import sys
from fulcrum.scenarios import scenario
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.plant.mujoco import MujocoPlant
step = MujocoPlant.step
def first(self):
    step(self)
    print("stepped", flush=True)
    sys.exit()
MujocoPlant.step = first
box_tilt = scenario("box-tilt")
execute(Request(box_tilt, "margin", box_tilt.control, out=Path(sys.argv[1])))
"""
WHOLE_RUN = """
from pathlib import Path
import sys
from fulcrum.scenarios import scenario
from fulcrum.sim.run.execute import Request, execute
box_tilt = scenario("box-tilt")
execute(Request(box_tilt, "margin", box_tilt.control, out=Path(sys.argv[1])))
"""


def request_at(rate, out=None):
    """A run with so many syntheses per second."""
    box_tilt = scenario("box-tilt")
    every = round(1.0 / (rate * box_tilt.physics.timestep))
    return Request(box_tilt, "margin", replace(box_tilt.control, solve_every=every), out=out)


@contextlib.contextmanager
def breakdown():
    """Seconds per part while the context lasts, by wrappers that add about 0.3 us per call."""
    spent, stack = defaultdict(float), []

    def wrapped(part, function):
        def call(*args, **kwargs):
            stack.append(0.0)
            started = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                elapsed = time.perf_counter() - started
                spent[part] += elapsed - stack.pop()
                if stack:
                    stack[-1] += elapsed

        return call

    with pytest.MonkeyPatch.context() as patch:
        for part, calls in PARTS.items():
            for owner, name in calls:
                if hasattr(owner, name):
                    patch.setattr(owner, name, wrapped(part, getattr(owner, name)))
        yield spent


@pytest.fixture(scope="module")
def at_1000_hz(tmp_path_factory):
    return execute(request_at(1000, tmp_path_factory.mktemp("run")))


@pytest.mark.parametrize("rate", RATES)
def test_real_time_factor(rate, tmp_path, table):
    report = execute(request_at(rate, tmp_path / "run")).report
    factor = report.timing.real_time_factor
    with breakdown() as spent:
        execute(request_at(rate, tmp_path / "again"))
    total = sum(spent.values())
    shares = ", ".join(f"{part} {100 * spent[part] / total:.0f} %" for part in PARTS)
    table.add(LOOP, f"real-time factor, synthesis at {rate} Hz", factor, "x",
              note=f"{report.verdict}; {shares}")  # fmt: skip
    asked = {250: 12.0, 1000: 4.0}.get(rate)
    if asked:
        table.bar(f"real-time factor at {rate} Hz", factor, asked, at_least=True)


def test_bare_steps(at_1000_hz, table):
    result = at_1000_hz
    tau = result.trace.tau
    plant = MujocoPlant(scenario("box-tilt"))
    plant.reset(result.trace.q[0])
    model, data = plant.physics.model.ptr, plant.physics.data.ptr
    started = time.perf_counter()
    for torques in tau:
        data.ctrl[:] = torques
        mujoco.mj_step(model, data)
    bare = time.perf_counter() - started
    # The torques of the run, replayed: the box ends where it did, or something else was timed.
    np.testing.assert_allclose(data.time, result.trace.t[-1], atol=0.01)
    table.add(LOOP, f"bare mj_step, mean of {len(tau)} replayed", 1e3 * bare / len(tau))
    table.bar("wall time at 1000 Hz over bare mj_steps", result.report.timing.wall_s / bare, 12.0)


def _environment():
    return os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}


def test_start_of_help(table):
    command = Path(sys.executable).with_name("fulcrum")
    start = [str(command)] if command.exists() else [
        sys.executable, "-c", "from fulcrum.scenarios.cli import main; main()"]  # fmt: skip
    times = []
    for _ in range(6):
        started = time.perf_counter()
        subprocess.run([*start, "--help"], check=True, capture_output=True, env=_environment())
        times.append(time.perf_counter() - started)
    # The first one reads files that the others find in memory.
    median = float(np.median(times[1:]))
    table.add(START, "fulcrum --help", median, "s", note=f"first one {times[0]:.2f} s")
    table.bar("fulcrum --help [s]", median, 0.5)


def test_start_of_a_run(tmp_path, table):
    times = []
    for i in range(3):
        started = time.perf_counter()
        command = [sys.executable, "-c", FIRST_STEP, str(tmp_path / f"{i}")]
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=_environment()) as child:
            assert child.stdout.readline().strip() == b"stepped"
            times.append(time.perf_counter() - started)
    table.add(START, "run to its first step", min(times), "s", note=f"slowest {max(times):.2f} s")
    table.bar("run to its first step [s]", min(times), 3.0)


def test_peak_memory(tmp_path, table):
    script = WHOLE_RUN + "\nimport resource\n"
    script += "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    run = [sys.executable, "-c", script, str(tmp_path / "run")]
    done = subprocess.run(run, check=True, capture_output=True, env=_environment())
    # Linux counts in KiB, macOS in bytes.
    unit = 2**20 if sys.platform == "darwin" else 2**10
    table.add(START, "peak memory of a recorded run", int(done.stdout.split()[-1]) / unit, "MiB")
