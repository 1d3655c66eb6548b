"""Collects the benchmark's rows and bars, prints them as one table and writes benchmark.json."""

import json
import os
import platform
import time
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pytest

PACKAGES = ("clarabel", "numpy", "cvxpy", "ecos", "qoco", "qpsolvers", "daqp", "proxsuite", "piqp",
            "drake", "mujoco", "pin")  # fmt: skip
WARM_UP = 50
# Poses per turn of two functions that are compared.
TURN = 20


@dataclass(frozen=True)
class Row:
    """One measured quantity.

    Attributes:
        group: Which part of the table it belongs to.
        name: What was measured.
        value: Median of the samples, or the one value.
        unit: Of the value.
        p99: 99th percentile of the samples, if there are many.
        note: What else is to be known, such as why the row was skipped.
    """

    group: str
    name: str
    value: float | None
    unit: str = "ms"
    p99: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Bar:
    """What a measured quantity has to be: at most (or at least) the asked one."""

    name: str
    measured: float
    asked: float
    at_least: bool = False

    @property
    def passed(self):
        return self.measured >= self.asked if self.at_least else self.measured <= self.asked


@dataclass
class Table:
    """Rows and bars in the order in which they came."""

    rows: list[Row] = field(default_factory=list)
    bars: list[Bar] = field(default_factory=list)

    def add(self, group, name, value, unit="ms", p99=None, note=""):
        self.rows.append(Row(group, name, value, unit, p99, note))

    def skip(self, group, name, reason):
        self.add(group, name, None, note=f"skipped: {reason}")

    def bar(self, name, measured, asked, at_least=False):
        self.bars.append(Bar(name, float(measured), asked, at_least))

    def value(self, name):
        """Of the row of that name; None if it was skipped or not run."""
        return next((r.value for r in self.rows if r.name == name), None)


TABLE = Table()


@pytest.fixture(scope="session")
def table():
    return TABLE


@pytest.fixture
def timed(benchmark, table):
    """Times a function once for each of many arguments, warm, and adds a row."""

    def run(group, name, function, arguments, note="", warm_up=WARM_UP):
        for args in arguments[:warm_up]:
            function(*args)
        poses = iter(arguments)
        benchmark.pedantic(function, setup=lambda: (next(poses), {}), rounds=len(arguments))
        samples = 1e3 * np.array(benchmark.stats.stats.data)
        table.add(group, name, float(np.median(samples)), "ms",
                  float(np.percentile(samples, 99)), note)  # fmt: skip
        return samples

    return run


def wall_times(function, arguments):
    """Wall time of one call for each of many arguments [s]."""
    times = []
    for args in arguments:
        started = time.perf_counter()
        function(*args)
        times.append(time.perf_counter() - started)
    return times


def ratio(first, second):
    """Median time of one function over that of another, each a pair of function and arguments.

    They take turns, some poses each, so that whatever else the machine does slows both.
    """
    times = [], []
    for start in range(0, len(first[1]), TURN):
        for samples, (function, arguments) in zip(times, (first, second), strict=True):
            samples += wall_times(function, arguments[start : start + TURN])
    return float(np.median(times[0]) / np.median(times[1]))


def pytest_addoption(parser):
    parser.addoption("--out", default="logs/benchmark.json", help="where the figures are written")


def pytest_configure(config):
    config.option.benchmark_quiet = True
    config.option.benchmark_disable_gc = True


def pytest_terminal_summary(terminalreporter, config):
    if not TABLE.rows:
        return
    write = terminalreporter.write_line
    group = None
    for row in TABLE.rows:
        if row.group != group:
            group = row.group
            write(f"\n{group:<54}{'median':>12}{'p99':>10}")
        value = "-" if row.value is None else f"{row.value:.4g} {row.unit}"
        p99 = "" if row.p99 is None else f"{row.p99:.4g}"
        write(f"  {row.name:<52}{value:>12}{p99:>10}  {row.note}")
    write(f"\n{'bars':<54}{'measured':>12}{'asked':>10}")
    for bar in TABLE.bars:
        asked = f"{'>=' if bar.at_least else '<='} {bar.asked:g}"
        verdict = "pass" if bar.passed else "MISS"
        write(f"  {bar.name:<52}{bar.measured:>12.4g}{asked:>10}  {verdict}")
    out = Path(config.getoption("--out"))
    out.parent.mkdir(parents=True, exist_ok=True)
    content = {
        "machine": {"cpu": _cpu(), "cores": os.cpu_count(), "python": platform.python_version()},
        "versions": _versions(),
        "rows": [asdict(row) for row in TABLE.rows],
        "bars": [asdict(bar) | {"passed": bool(bar.passed)} for bar in TABLE.bars],
    }
    out.write_text(json.dumps(content, indent=1) + "\n")
    write(f"\nwritten to {out}")


def _cpu():
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(": ")[1] for line in lines if line.startswith("model name")), "")


def _versions():
    found = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
