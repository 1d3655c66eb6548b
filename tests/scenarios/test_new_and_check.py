"""The commands that begin a scenario file and check one: ``fulcrum new`` and ``fulcrum check``."""

import json
import re
import tomllib
from dataclasses import replace

import jsonschema
import pytest

from fulcrum.scenarios import scenario, scenarios
from fulcrum.scenarios.commands.sweep import SweepCommand
from fulcrum.scenarios.reading.file import SCHEMA, TEMPLATE, read, scene_files, schema
from fulcrum.scenarios.schema.writer import write
from fulcrum.sim.scenario.control import Guard
from tests.helpers.broken_files import GOOD
from tests.helpers.scenario_files import ended, folder, said

__all__ = ["folder"]
SHIPPED = {**scene_files(), "template": TEMPLATE}
each_file = pytest.mark.parametrize("file", SHIPPED.values(), ids=SHIPPED)


# --- fulcrum new ---


@each_file
def test_a_file_that_is_written_says_what_the_other_says(file):
    data = tomllib.loads(file.read_text())
    assert tomllib.loads(write(data, "schema")) == data


def test_new_writes_a_file_that_explains_every_key_and_never_overwrites(folder, capsys):
    assert ended("new mine", capsys)[0] == 0
    text = (folder / "mine.toml").read_text()
    assert text.startswith(f"#:schema {SCHEMA.name}\n")
    assert (folder / SCHEMA.name).read_text() == SCHEMA.read_text()
    assert str(SCHEMA.parent) not in text and "file:" not in text
    assert replace(scenario("mine.toml"), name="template") == read(TEMPLATE)
    for key in ("density_kg_per_m3", "friction_factor", "timestep_s", "slip_mm", "eye_m"):
        before = text.partition(f"#{key} = ")[0].splitlines()[-1]
        assert before.startswith("# ")
    code, _, errors = ended("new mine --from cylinder-tilt", capsys)
    assert (code, (folder / "mine.toml").read_text()) == (2, text)
    assert "exists" in errors


def test_new_brings_the_schema_up_to_date_and_leaves_another_file_of_its_name(folder, capsys):
    for text, left in (('{"title": "fulcrum scenario"}', False), ('{"title": "mine"}', True)):
        (folder / SCHEMA.name).write_text(text)
        assert ended(f"new mine{left}", capsys)[0] == 0
        assert ((folder / SCHEMA.name).read_text() == text) == left


def test_new_from_another_scenario_is_that_scenario(folder, capsys):
    for name in scenarios():
        assert ended(f"new copy-of-{name} --from {name}", capsys)[0] == 0
        copy = scenario(f"copy-of-{name}.toml")
        assert replace(copy, name=name) == scenario(name)
    assert ended("new again --from copy-of-box-tilt.toml", capsys)[0] == 0
    assert scenario("again.toml").object == scenario("box-tilt").object


def test_new_for_another_box_keeps_the_edge_and_fits_the_table(folder, capsys):
    options = "--size 0.4 0.3 0.15 --weight 35 --friction 0.2 0.5"
    assert ended(f"new mine {options}", capsys)[0] == 0
    s, template = scenario("mine.toml"), read(TEMPLATE)
    assert s.object.geoms[0].size == (0.2, 0.15, 0.075)
    assert s.object.mass * 9.81 == pytest.approx(35.0)
    assert [c.friction.mu for c in (*s.hands, *s.supports)] == [0.2, 0.2, 0.5, 0.5]
    assert s.path.point_W == pytest.approx(template.path.point_W, abs=1e-12)
    # The template is what the same rule makes of its own box.
    assert ended("new same --size 0.3 0.2 0.1", capsys)[0] == 0
    assert replace(scenario("same.toml"), name="template") == template


def test_keys_that_are_switched_on_keep_to_the_schema():
    data = tomllib.loads(GOOD)
    on = re.sub(r"^#(?=[a-z_\[])", "", write(data, "schema"), flags=re.M)
    validator = jsonschema.Draft202012Validator(schema())
    enabled = tomllib.loads(on)
    assert enabled["control"]["guard"]["hold_s"] == Guard.hold_s
    assert list(validator.iter_errors(enabled)) == []


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("new 'my box'", "letters"),
        ("new nowhere/mine", "folder that exists"),
        ("new mine --from sofa-tilt", "box-tilt, perhaps"),
        ("new mine --from none.toml", "No such file"),
        ("new mine --from good.txt", "ending in .toml"),
        ("new mine --size 0.1 0 0.1", "a finite number > 0"),
        ("new mine --weight nan", "a finite number > 0"),
        ("new mine --friction 0.3", "--help"),
        ("new mine --from box-tilt --weight 3", "left out with --from"),
    ],
)
def test_new_refuses_what_it_cannot_write(line, answer, folder, capsys):
    code, output, errors = ended(line, capsys)
    assert (code, output) == (2, "")
    assert answer in errors
    assert not (folder / "mine.toml").exists()


# --- fulcrum check, and other commands ---


@pytest.mark.parametrize("name", scenarios())
def test_check_says_of_every_scenario_whether_it_can_be_held(name, folder, capsys):
    # The robust grip of what cannot be held takes long, and says no more.
    holdable = scenario(name).holdable
    controller = "robust" if holdable else "margin"
    code, output, _ = ended(f"check {name} --controller {controller} --out {name}", capsys)
    assert code == (0 if holdable else 1)
    content = json.loads((folder / name / "check.json").read_text())
    assert content["feasible"] is (code == 0)
    assert (content["explanation"] is None) is (code == 0)
    assert ("must change" in output) is (code == 1)
    assert (folder / name / "check.png").read_bytes().startswith(b"\x89PNG")


def test_what_is_out_of_reach_is_said_by_check_and_refused_by_run(folder, capsys):
    said(
        folder,
        ("[0.65, 0.0, 0.05]", "[1.25, 0.0, 0.05]"),
        ("[0.6, 0.0, 0.0]", "[1.2, 0.0, 0.0]"),
    )
    code, output, _ = ended("check said.toml --out far --json far.json", capsys)
    assert code == 1
    assert "out of reach" in output and "fulcrum place said.toml" in output
    content = json.loads((folder / "far.json").read_text())
    assert content["unreachable"]["reasons"] == ["out of reach of the arms"]
    assert {path.name for path in (folder / "far").iterdir()} == {"check.png"}
    code, output, errors = ended("run said.toml", capsys)
    assert (code, output) == (2, "")
    assert re.match(r"fulcrum: said\.toml:\d+: path: .* out of reach of the arms", errors)


def test_a_tilt_that_is_too_fast_is_told_how_slow_it_has_to_be(folder, capsys):
    said(folder, ("tilt_s = 8.0", "tilt_s = 1.0"))
    code, output, _ = ended("check said.toml --controller margin --out fast", capsys)
    assert code == 1
    assert "speed limit" in output
    factor = float(re.search(r"lasts ([\d.]+) times as long", output)[1])
    said(folder, ("tilt_s = 8.0", f"tilt_s = {factor}"))
    assert ended("check said.toml --controller margin --out slow", capsys)[0] == 0


def test_commands_take_a_file_and_its_replay_names_it(folder, capsys):
    assert ended("explain good.toml --json why.json", capsys)[0] == 0
    assert json.loads((folder / "why.json").read_text())["scenario"] == "good"
    assert ended("plan good.toml --points 20 --out plan", capsys)[0] == 0
    assert ended("run good.toml --seed -1", capsys)[2].startswith("fulcrum: --seed: ")
    design = SweepCommand("good.toml", 1)._sweep()
    replay = design.replay(design.all_episodes()[0])
    assert replay.startswith("fulcrum run good.toml --controller")
