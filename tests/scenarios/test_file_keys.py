"""Every setting of a scenario has its key in the file, and no text is read without an answer."""

import math
import random
import re
import tomllib
from dataclasses import fields

import pytest

from fulcrum.scenarios.reading.file import made, read, scene_files
from fulcrum.scenarios.reading.settings import control, disturbed, phases, physics, tolerances
from fulcrum.scenarios.reading.source import FileError, Source
from fulcrum.scenarios.schema.settings import (
    ControlTable,
    DisturbedTable,
    GuardTable,
    ManoeuvreTable,
    PhysicsTable,
    RobustnessTable,
    TolerancesTable,
)
from fulcrum.scenarios.schema.writer import write
from fulcrum.sim.scenario.control import Control, Guard, Robustness
from fulcrum.sim.scenario.phases import Phase
from fulcrum.sim.scenario.physics import DISTURBED, Physics, Tolerances
from fulcrum.synthesis import FulcrumError, Objective
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
from tests.helpers.broken_files import GOOD


def other(value):
    """Another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, Objective):
        return Objective.MAX_TORQUE
    if value is None:
        return 0.125
    if isinstance(value, list):
        return [other(item) for item in value]
    return value + 1 if isinstance(value, int) else 0.5 * value or 0.125


def changed(table, **tables):
    """The table with all of its values changed, and with other tables in it."""
    own = {n: other(getattr(table, n)) for n in type(table).model_fields if n not in tables}
    return type(table)(**own, **tables)


def same(config, default):
    """Names of the fields in which two dataclasses agree."""
    return {f.name for f in fields(default) if getattr(config, f.name) == getattr(default, f.name)}


def test_every_setting_has_its_key():
    guard = changed(GuardTable())
    own = control(changed(ControlTable(), robustness=changed(RobustnessTable()), guard=guard))
    assert same(own, Control()) == set()
    assert same(own.guard, Guard()) == set()
    assert own.robustness is not None
    assert same(own.robustness, Robustness(UncertaintySet(), preload=0.0)) == set()
    assert same(own.robustness.uncertainty, UncertaintySet()) == set()
    assert same(physics(changed(PhysicsTable())), Physics()) == set()
    own = changed(TolerancesTable(), disturbed=DisturbedTable())
    assert same(tolerances(own), Tolerances()) == set()
    finite = DisturbedTable(**{n: 0.25 for n, v in vars(DISTURBED).items() if v == math.inf})
    assert same(disturbed(changed(finite)), DISTURBED) == set()
    assert disturbed(DisturbedTable()) == DISTURBED


def test_a_setting_without_a_key_is_noticed():
    assert same(control(ControlTable(preload_n=7.0)), Control()) == {
        f.name for f in fields(Control) if f.name != "preload"
    }


def test_every_part_of_a_phase_but_a_planned_timing_has_its_key():
    table = {"name": "a", "duration_s": 2.0, "tilt": 0.5, "gap_m": 0.0, "grip": 0.25}
    source = Source(scene_files()["box-tilt"], GOOD)
    (own,) = phases(source, ManoeuvreTable(phases=[table]))
    assert own == Phase("a", 2.0, tilt=0.5, gap=0.0, grip=0.25)
    assert {f.name for f in fields(Phase)} - {name.removesuffix("_m") for name in table} == {
        "timing"
    }


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
