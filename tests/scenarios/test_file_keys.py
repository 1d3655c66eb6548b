"""Every setting of a scenario has its key in the file, and no text is read without an answer."""

import math
import random
import re
import tomllib
from dataclasses import fields

import pytest
from pydantic import TypeAdapter

from fulcrum.scenarios.reading.file import made, read, scene_files
from fulcrum.scenarios.reading.source import FileError, Source
from fulcrum.scenarios.schema.derive import FromTable, table_of
from fulcrum.scenarios.schema.writer import write
from fulcrum.sim.scenario.contacts import Friction
from fulcrum.sim.scenario.control import Control, Guard, Robustness
from fulcrum.sim.scenario.phases import Phase
from fulcrum.sim.scenario.physics import Disturbed, Physics, Tolerances
from fulcrum.sim.scenario.scenario import View
from fulcrum.synthesis import FulcrumError, Objective
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
from fulcrum.synthesis.settings import Key, hints, said
from tests.helpers.broken_files import GOOD


def other(value):
    """Another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, Objective):
        return Objective.MAX_TORQUE
    if value is None:
        return 0.125
    if value == math.inf:
        return 0.25
    if isinstance(value, list):
        return [other(item) for item in value]
    return value + 1 if isinstance(value, int) else 0.5 * value or 0.125


def changed(settings, **given):
    """What a file says that changes every key of a settings class which has a default."""
    fields = table_of(settings).model_fields.items()
    return {
        name: given[name] if name in given else other(field.get_default(call_default_factory=True))
        for name, field in fields
    }


def read_as(settings, table):
    """The instance of a settings class that a table of a file stands for."""
    return TypeAdapter(FromTable[settings]).validate_python(table)


def same(config, default):
    """Names of the fields in which two dataclasses agree."""
    return {f.name for f in fields(default) if getattr(config, f.name) == getattr(default, f.name)}


def test_every_setting_has_its_key():
    inner = {"robustness": changed(Robustness), "guard": changed(Guard)}
    own = read_as(Control, changed(Control, **inner))
    assert same(own, Control()) == set()
    assert same(own.guard, Guard()) == set()
    assert own.robustness is not None
    assert same(own.robustness, Robustness(UncertaintySet(), preload=0.0)) == set()
    assert same(own.robustness.uncertainty, UncertaintySet()) == set()
    for settings in (Physics, View, Disturbed):
        assert same(read_as(settings, changed(settings)), settings()) == set()
    own = read_as(Tolerances, changed(Tolerances, disturbed=changed(Disturbed)))
    assert same(own, Tolerances()) == set()
    assert read_as(Friction, {"mu": 0.5, "torsion_m": 0.01}) == Friction(0.5, e_n=0.01)


def test_a_setting_without_a_key_is_noticed():
    assert same(read_as(Control, {"preload_n": 7.0}), Control()) == {
        f.name for f in fields(Control) if f.name != "preload"
    }


def test_every_part_of_a_phase_but_a_planned_timing_has_its_key():
    table = {"name": "a", "duration_s": 2.0, "tilt": 0.5, "gap_m": 0.0, "grip": 0.25}
    assert read_as(Phase, table) == Phase("a", 2.0, tilt=0.5, gap=0.0, grip=0.25)
    assert set(table_of(Phase).model_fields) == set(table)
    assert {f.name for f in fields(Phase)} - {name.removesuffix("_m") for name in table} == {
        "timing"
    }


@pytest.mark.parametrize("settings", [Control, Guard, Robustness, Physics, Tolerances, View])
def test_an_empty_table_is_the_default_of_the_code(settings):
    assert read_as(settings, {}) == settings()


def refused(make, **values):
    try:
        make(**values)
    except ValueError:
        return True
    return False


@pytest.mark.parametrize("settings", [Control, Guard, Physics, Tolerances])
def test_tables_and_code_refuse_the_same_numbers(settings):
    answers = set()
    for field in fields(settings):
        if not isinstance(field.default, float):
            continue
        key = (said(hints(settings)[field.name], Key) or Key(field.name)).name
        for value in (-1.0, 0.0, 0.5, 1.0, 2.0, math.nan):
            by_code = refused(settings, **{field.name: value})
            assert refused(table_of(settings), **{key: value}) == by_code, (key, value)
            answers.add(by_code)
    assert answers == {True, False}


# --- whatever stands in a file ---

VALUES = (
    *("nan", "inf", "0", "-1", "1e300", "1e-300", "1" + 400 * "0", "true", "'x'", "''", "[]", "{}"),
    *("[[]]", "[1]", "[0, 0, 0]", "[nan, 0, 0]", "[1e300, 0, 0]", "2026-01-01", "{ mu = 1e300 }"),
    *(
        '"\\u0000"',
        '"\\n"',
        '"../x"',
        "[1, 2, 3, 4]",
        '"-x+y-z"',
        '"[bold]"',
        "1 2",
        '"',
        "[",
        "'''",
    ),
)


def spoiled(text, rng):
    """A text with some of its lines changed."""
    lines = text.splitlines()
    for _ in range(rng.choice((1, 1, 2, 3))):
        i = rng.randrange(len(lines))
        key, equals, _ = lines[i].partition("=")
        match rng.randrange(6):
            case 0 | 1 | 2 if equals:
                lines[i] = f"{key.lstrip('#')}= {rng.choice(VALUES)}"
            case 3:
                lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
            case 4:
                lines.insert(i, rng.choice(lines))
            case _:
                lines[i] = lines[i].replace("_m", "_mm").replace("left", "lft")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("seed", range(4))
def test_a_spoiled_file_is_read_or_refused_in_a_sentence(seed, tmp_path):
    rng, file = random.Random(seed), tmp_path / "f.toml"
    explained = re.sub(r"^#(?=[a-z_])", "", write(tomllib.loads(GOOD), "schema"), flags=re.M)
    texts = (GOOD, explained, *(path.read_text() for path in scene_files().values()))
    refused = 0
    for _ in range(100):
        try:
            made(Source(file, spoiled(rng.choice(texts), rng)))
        except FileError as error:
            refused += 1
            sentence = " ".join(str(error).split())
            place = re.escape(str(file))
            assert re.fullmatch(rf"{place}(:\d+)?(: .+?)?: got .+; valid is .+\.", sentence)
    assert refused > 30


def test_what_is_no_text_is_refused(tmp_path):
    for name, content in (("binary", b"\xff\xfe\x00"), ("deep", b"a = " + 5000 * b"[")):
        (tmp_path / f"{name}.toml").write_bytes(content)
        with pytest.raises(FulcrumError, match="valid is"):
            read(tmp_path / f"{name}.toml")
    with pytest.raises(FileError, match="directory"):
        read(tmp_path)
