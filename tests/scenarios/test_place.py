"""`fulcrum place`: the file that it writes, what it says, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
import tomlkit
from PIL import Image

from fulcrum.scenarios import scenario
from fulcrum.scenarios.cli import main
from fulcrum.scenarios.reading.file import made, read, scene_files
from fulcrum.scenarios.reading.placed import placed
from fulcrum.scenarios.reading.source import Source
from fulcrum.sim.analysis.capacity import capacities
from fulcrum.sim.placement.freedom import Freedom, Moves

# The first 3 degrees of the shipped tilt, from farther back; simulated in 1.4 s.
PHASES = """
standoff_m = 0.002
phases = [
    { name = "touch", duration_s = 0.2, tilt = 0.0, gap_m = 0.0, grip = 0.0 },
    { name = "grip", duration_s = 0.5, tilt = 0.0, gap_m = 0.0, grip = 1.0 },
    { name = "tilt", duration_s = 0.6, tilt = 1.0, gap_m = 0.0, grip = 1.0 },
    { name = "hold", duration_s = 0.1, tilt = 1.0, gap_m = 0.0, grip = 1.0 },
]
"""
QUICK = ["--evaluations", "8", "--workers", "1"]
QUICK += [word for kept in ("hands", "turn", "posture") for word in ("--keep", kept)]


@pytest.fixture
def file(tmp_path):
    text = scene_files()["box-tilt"].read_text("utf-8")
    document = tomlkit.parse(text)
    document["path"]["angle_deg"] = 3.0
    document["robots"][0]["position_m"] = [-0.03, 0.0, 0.0]
    del document["manoeuvre"]
    document["manoeuvre"] = tomlkit.parse(PHASES)
    path = tmp_path / "short.toml"
    path.write_text(tomlkit.dumps(document), "utf-8")
    return path


def changed_lines(before, after):
    """Lines of the second text that the first has not."""
    return [line for line in after.splitlines() if line not in before.splitlines()]


def test_place_writes_a_file_whose_gain_another_command_confirms(file, capsys):
    given = file.read_text("utf-8")
    assert main(["place", str(file), "--goal", "heaviest", "--controller", "margin", *QUICK]) == 0
    said = capsys.readouterr().out
    assert "BETTER" in said and "In closed loop: PASS" in said
    assert file.read_text("utf-8") == given
    out = file.with_name("short-placed.toml")
    weights = []
    for path in (file, out):
        found = read(path)
        weights.append(capacities(found, found.control)[0].weight)
        assert f"{weights[-1]:.2f} N" in said
    # 42.4 N and more than 57 N: 0.15 m nearer (tests/sim/placement/test_placement.py).
    assert weights[1] > 1.2 * weights[0]
    assert Image.open(out.with_suffix(".png")).size[0] > 500
    # Only the base has been let go; the posture is what the hands settle to from there.
    names = {line.partition(" =")[0] for line in changed_lines(given, out.read_text("utf-8"))}
    joints = set(read(file).posture)
    assert "position_m" in names
    assert names <= {"position_m"} | joints | {n for n in names if n.startswith("# Placed by")}
    # Nothing is written over unless it is said.
    assert main(["place", str(file), *QUICK]) == 2
    assert "--overwrite" in capsys.readouterr().err


def test_nothing_better_writes_nothing(file, capsys):
    arguments = ["place", str(file), "--controller", "margin", *QUICK, "--keep", "base"]
    assert main(arguments) == 2
    assert "something that may move" in capsys.readouterr().err
    assert main(["place", str(file), "--controller", "paper", "--reach", "1e-6", *QUICK]) == 1
    assert "NOTHING BETTER" in capsys.readouterr().out
    assert not file.with_name("short-placed.toml").exists()


@pytest.mark.parametrize("name", [n for n in scene_files() if "lift" not in n])
def test_a_file_says_what_was_found_and_keeps_its_comments(name, tmp_path):
    text, before = scene_files()[name].read_text("utf-8"), scenario(name)
    fixed = {} if before.object.shape is None or len(before.object.geoms) > 1 else None
    moves = Moves(before, Freedom(faces=fixed, height=(-0.1, 0.1)))
    rng = np.random.default_rng(5)
    for x in rng.random((3, len(moves.names))):
        after = moves.scenario(x)
        written = placed(text, before, after, "A note.", elsewhere=True)
        found = made(Source(tmp_path / f"{name}.toml", written))
        for hand, other in zip(found.hands, after.hands, strict=True):
            # Micrometres, and directions of nine digits.
            assert np.allclose(hand.p_OC_O, other.p_OC_O, rtol=0.0, atol=2e-6)
            # A micrometre on a radius of 70 mm turns both by 1.4e-5 rad.
            assert np.allclose(hand.normal_O, other.normal_O, rtol=0.0, atol=3e-5)
            assert np.allclose(hand.tangent_O, other.tangent_O, rtol=0.0, atol=3e-5)
            assert hand.geom == other.geom
        for robot, other in zip(found.robots, after.robots, strict=True):
            assert np.allclose(robot.base.position, other.base.position, rtol=0.0, atol=1e-6)
            # A quaternion's sign is no matter.
            turn = np.abs(np.dot(robot.base.quaternion, other.base.quaternion))
            assert turn == pytest.approx(1.0, abs=1e-9)
            assert robot.posture == pytest.approx(other.posture, abs=1e-6)
        assert replace(found, hands=before.hands, robots=before.robots) == before
        comments = [line for line in text.splitlines()[1:] if line.startswith("#")]
        assert comments == [line for line in written.splitlines()[2:] if line.startswith("#")]
        assert written.splitlines()[1] == "# A note."


def test_a_file_that_says_less_is_caught():
    # Negative control of the test above.
    text, before = scene_files()["box-tilt"].read_text("utf-8"), scenario("box-tilt")
    moves = Moves(before, Freedom())
    after = moves.scenario(np.full(len(moves.names), 0.3))
    half = replace(after, hands=before.hands)
    found = made(Source(scene_files()["box-tilt"], placed(text, before, half, "", False)))
    assert not np.allclose(found.hands[0].p_OC_O, after.hands[0].p_OC_O, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["box-lift"], "place that one instead"),
        (["box-tilt", "--goal", "cheapest"], "one of heaviest, largest-margin, lowest-torque"),
        (["box-tilt", "--controller", "best"], "one of robust"),
        (["box-tilt", "--out", "placed.txt"], "a file .toml"),
        (["box-tilt", "--out", "nowhere/placed.toml"], "folder that exists"),
        (["box-tilt", "--reach", "-1"], "--reach"),
        (["box-tilt", "--seconds", "nan"], "--seconds"),
        (["no-such-scene"], "one of"),
    ],
)
def test_what_cannot_be_placed_is_refused_in_one_line(
    arguments, said, capsys, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    assert main(["place", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())
