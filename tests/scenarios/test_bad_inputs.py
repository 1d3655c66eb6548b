"""No bad input ends in a traceback, a NaN or a hang: 2,000 of them, made by Hypothesis."""

import contextlib
import dataclasses
import io
import math
import re
import signal
import warnings
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from fulcrum.scenarios import scenario, scenarios
from fulcrum.scenarios.cli import main
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.world.faults import Fault, FaultKind
from fulcrum.sim.world.presets import FIELD, draw
from fulcrum.synthesis import Contact, FulcrumError, Joints, Problem, Synthesizer
from tests.helpers.short_run import short_tilt

# They take 2, 20 and 20 ms each.
PROBLEMS, CONFIGS, COMMANDS = 1500, 200, 300
# The slowest good one takes a tenth of it, on a machine with other work to do [s].
DEADLINE_S = 20
NUMBERS = (math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1e-300, -1e-300, 1e300, 1e8, 1e-8, 0.5)
BOX = scenario("box-tilt")
# The same with a short path, along which inverse kinematics takes a third of the time.
SHORT = short_tilt(3.0, 0.6)


def limits(examples):
    """The same inputs every time, and none that is given up for being slow: see within()."""
    return settings(
        max_examples=examples,
        derandomize=True,
        deadline=None,
        database=None,
        phases=(Phase.generate,),  # the first one that fails is simple enough
        suppress_health_check=list(HealthCheck),
    )


@contextlib.contextmanager
def within(seconds):
    """Raises TimeoutError in what takes longer."""

    def expired(number, frame):
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, expired)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def numbers_of(value):
    """All numbers in nested dataclasses, mappings, sequences and arrays."""
    if isinstance(value, np.ndarray):
        yield from value.ravel().tolist()
    elif isinstance(value, float):
        yield value
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from numbers_of(getattr(value, field.name))
    elif isinstance(value, (tuple, list)):
        for item in value:
            yield from numbers_of(item)


def outcome(action):
    """What an action ends in: "refused", or "done" with finite numbers; all else raises."""
    with within(DEADLINE_S), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # overflow of what is refused after
        try:
            result = action()
        except FulcrumError as error:
            assert is_one_sentence(str(error)), error
            return "refused"
    assert all(map(math.isfinite, numbers_of(result)))
    return "done"


def is_one_sentence(text):
    return bool(re.fullmatch(r"\S.*\.", text)) and "Traceback" not in text


# --- problems ---


@cache
def good_problem(joints):
    """A problem of the scene as keyword arguments: its own, its contacts', and its joints'."""
    problems = PathProblems(BOX, BOX.control)
    problem = problems.problem(math.radians(30.0))
    fields = {n: getattr(problem, n) for n in ("R_OC", "p_OC_O", "w_ext_O", "objective")}
    contacts = [
        {f.name: getattr(contact, f.name) for f in dataclasses.fields(Contact)}
        for contact in problem.contacts
    ]
    arms = {f.name: getattr(problem.joints, f.name) for f in dataclasses.fields(Joints)}
    return fields, contacts, arms if joints else None


def bad_array(data, array):
    """The array with a few entries, all of them, or its shape made bad."""
    how = data.draw(st.sampled_from(("entry", "entry", "all", "scale", "shape")))
    array = np.atleast_1d(np.array(array, float))
    if how == "scale":
        return array * data.draw(st.sampled_from((1e-300, 1e-12, 1e-6, 1e6, 1e12, 1e300, -1.0)))
    if how == "all":
        return np.full_like(array, data.draw(st.sampled_from(NUMBERS)))
    if how == "shape":
        shapes = (array[:-1], array[None], array.ravel(), np.zeros(0), np.float64(1.0), array.T)
        return np.asarray(data.draw(st.sampled_from(shapes)))
    if array.size:
        index = data.draw(st.integers(0, array.size - 1))
        array.flat[index] = data.draw(st.sampled_from(NUMBERS))
    return array


def bad_problem(data):
    """Solves a problem with one to three of its fields made bad."""
    fields, contacts, arms = good_problem(data.draw(st.booleans()))
    fields, contacts = dict(fields), [dict(contact) for contact in contacts]
    arms = None if arms is None else dict(arms)
    fields["objective"] = data.draw(st.sampled_from(type(fields["objective"])))
    for _ in range(data.draw(st.integers(1, 3))):
        part = data.draw(st.sampled_from(("fields", "contact", "contacts", "joints")))
        if part == "fields":
            name = data.draw(st.sampled_from(("R_OC", "p_OC_O", "w_ext_O")))
            fields[name] = bad_array(data, fields[name])
        elif part == "contact" and contacts:
            contact = data.draw(st.sampled_from(contacts))
            names = ("mu", "e_t", "e_o", "e_n", "f_n_min", "f_n_max")
            contact[data.draw(st.sampled_from(names))] = data.draw(st.sampled_from(NUMBERS))
        elif part == "contacts":
            count = data.draw(st.integers(0, len(contacts)))
            contacts = contacts[:count] + contacts[: data.draw(st.integers(0, 1))]
        elif arms is not None:
            name = data.draw(st.sampled_from(("J_C", "tau_g", "tau_min", "tau_max")))
            arms[name] = bad_array(data, arms[name])

    def solve():
        joints = None if arms is None else Joints(**arms)
        made = tuple(Contact(**contact) for contact in contacts)
        solution = Synthesizer().solve(Problem(contacts=made, joints=joints, **fields))
        return solution.w_OC_C, solution.tau

    return solve


@limits(PROBLEMS)
@given(data=st.data())
def test_a_bad_problem_is_solved_or_refused_in_a_sentence(data):
    outcome(bad_problem(data))


# --- configurations ---


def leaves(value, path=()):
    """Paths to all values in nested dataclasses, tuples and mappings."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name), (*path, field.name))
    elif isinstance(value, tuple) and value and not isinstance(value[0], str):
        yield path
        for index, item in enumerate(value):
            yield from leaves(item, (*path, index))
    elif isinstance(value, dict):
        for key in value:
            yield (*path, key)
    else:
        yield path


def at(value, path):
    for step in path:
        value = getattr(value, step) if dataclasses.is_dataclass(value) else value[step]
    return value


def changed(value, path, new):
    """A copy of nested frozen data with another value at a path."""
    if not path:
        return new
    step, rest = path[0], path[1:]
    if dataclasses.is_dataclass(value):
        return dataclasses.replace(value, **{step: changed(getattr(value, step), rest, new)})
    if isinstance(value, dict):
        return {**value, step: changed(value[step], rest, new)}
    return (*value[:step], changed(value[step], rest, new), *value[step + 1 :])


def bad_value(data, value):
    """Something of the same kind that makes no sense, or hardly any."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return data.draw(st.sampled_from((-1, 0, 10**12, True, 2.5, math.nan)))
    if isinstance(value, float):
        return data.draw(st.sampled_from(NUMBERS))
    if isinstance(value, str):
        return data.draw(st.sampled_from(("", "nonsense", "box", "left", "\n", "a" * 1000)))
    if isinstance(value, tuple):
        return data.draw(st.sampled_from((value[:-1], value[::-1], (*value, *value[:1]))))
    return value


# Every field of a world is there to be made bad.
WORLD = dataclasses.replace(
    draw(FIELD, SHORT, seed=1),
    obstacles=(dataclasses.replace(SHORT.environment[0], name="post"),),
    faults=(
        Fault(FaultKind.TORQUE_STUCK, 0.05, joint="left_s0"),
        Fault(FaultKind.WEIGHT, 0.1, extra_n=5.0),
    ),
)
RANGES = dataclasses.replace(FIELD, joint_friction=0.01, torque_noise=0.01, encoder_noise=1e-4)


def bad_config(data):
    """Runs the first steps of a scenario, in a world, of which some values were made bad."""
    good = {"scenario": SHORT, "world": WORLD, "ranges": RANGES}
    which = data.draw(st.sampled_from(("scenario", "scenario", "world", "ranges")))
    paths = sorted(leaves(good[which]), key=str)
    chosen = data.draw(st.lists(st.sampled_from(paths), min_size=1, max_size=2, unique=True))
    values = [(path, bad_value(data, at(good[which], path))) for path in chosen]

    def run():
        made = dict(good)
        for path, value in values:
            try:
                made[which] = changed(made[which], path, value)
            except (AttributeError, IndexError):  # gone with the change before
                continue
        scene, world = made["scenario"], made["world"]
        if which == "ranges":
            world = draw(made["ranges"], scene, seed=1)
        loop = closed_loop(scene, scene.control, world=world)
        block = next(loop.run())
        return block.tau, block.q, block.p_WO, block.tilt

    return run


@limits(CONFIGS)
@given(data=st.data())
def test_a_bad_configuration_runs_or_is_refused_in_a_sentence(data):
    outcome(bad_config(data))


# --- command lines ---

NAMES = (*scenarios(), "box", "", "nonsense", "--help-me", "-1", "box-tilt\n", "*")
OPTIONS = {
    "run": ("--controller", "--objective", "--duration", "--seed", "--out"),
    "explain": ("--controller", "--tilt-deg", "--objective", "--json"),
    "capacity": ("--controller", "--json"),
    "screenshot": ("--at", "--out"),
    "view": (),
    "reproduce": ("--out",),
    "list": (),
    "nonsense": ("--at",),
}
VALUES = ("nan", "inf", "-inf", "-1", "0", "1e300", "1e-300", "x", "", "-", "1e9999", "/dev/null/x")
# What makes each command fail, whatever else it says: a good one would take seconds.
SPOILED = {
    "run": ("--seed", "-1"),
    "explain": ("--tilt-deg", "nan"),
    "capacity": ("--controller", "nobody"),
    "reproduce": ("--out", "/dev/null/x"),
}


def bad_command(data):
    command = data.draw(st.sampled_from(tuple(OPTIONS)))
    arguments = [command]
    if command not in ("list", "reproduce") or data.draw(st.booleans()):
        arguments.append(data.draw(st.sampled_from(NAMES)))
    for option in data.draw(st.lists(st.sampled_from((*OPTIONS[command], "--what")), max_size=2)):
        arguments += [option, data.draw(st.sampled_from(VALUES))]
    arguments += SPOILED.get(command, ())
    return arguments


@limits(COMMANDS)
@given(data=st.data())
def test_a_bad_command_line_ends_in_one_line_and_code_2(data):
    arguments = bad_command(data)
    output, errors = io.StringIO(), io.StringIO()
    with within(DEADLINE_S), contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        code = main(arguments)
    if code == 0:
        assert arguments[0] == "list"
        return
    assert code == 2, arguments
    assert output.getvalue() == ""
    assert re.fullmatch(r"fulcrum: \S.*\n", errors.getvalue()), arguments


# --- the checks themselves ---


@pytest.mark.parametrize("text", ["", "two\nlines.", "no end", " starts with a blank."])
def test_what_is_no_sentence_is_caught(text):
    assert not is_one_sentence(text)


def test_a_hang_a_nan_and_a_traceback_are_caught():
    def hang():
        while True:
            pass

    with pytest.raises(TimeoutError), within(1):
        hang()
    with pytest.raises(AssertionError):
        outcome(lambda: (np.array([1.0, np.nan]),))
    with pytest.raises(ZeroDivisionError):
        outcome(lambda: 1 / 0)
    assert outcome(lambda: (np.ones(3), 2.0)) == "done"
