"""The parts of sweeps: grids, scores, maps, folders, and what bad input is answered."""

from dataclasses import fields, replace

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image

from fulcrum.scenarios import scenario
from fulcrum.scenarios.cli import main
from fulcrum.sim.sweep.picture import draw_map
from fulcrum.sim.sweep.store import Store
from fulcrum.sim.sweep.summary import scores
from fulcrum.sim.world.parameters import PARAMETERS, overridden, parse_grid, parse_values
from fulcrum.sim.world.presets import FIELD, draw
from fulcrum.synthesis import InvalidInputError
from tests.helpers.sweeps import SCENE, short_sweep

# --- grids ---


@pytest.mark.parametrize(
    ("text", "grid"),
    [
        ("", ()),
        ("mass=1.1", (("mass", (1.1,)),)),
        ("weight=0.8", (("mass", (0.8,)),)),
        ("friction=0.7:1.3:7", (("friction", (0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3)),)),
        ("friction=0.7,0.85,mass=1:2:2", (("friction", (0.7, 0.85)), ("mass", (1.0, 2.0)))),
        (" com_x = -0.01:0.01:3 , 0.5", (("com_x", (-0.01, 0.0, 0.01, 0.5)),)),
    ],
)
def test_a_grid_is_read(text, grid):
    assert parse_grid("--grid", text) == grid


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("colour=1", "one of weight, mass"),
        ("0.7,0.8", "like friction"),
        ("mass", "like friction"),
        ("mass=", "numbers"),
        ("mass=heavy", "numbers"),
        ("mass=nan", "numbers"),
        ("mass=1,,2", "numbers"),
        ("mass=0:1", "numbers"),
        ("mass=0:1:1", "count from 2"),
        ("mass=0:1:-3", "count from 2"),
        ("mass=0:inf:3", "numbers"),
        ("mass=0:1:1000000000", "numbers"),
        ("mass=1,1", "only once"),
        ("mass=1,weight=2", "mass only once"),
    ],
)
def test_a_grid_that_is_none_is_refused(text, said):
    with pytest.raises(InvalidInputError, match=said):
        parse_grid("--grid", text)


def test_one_value_each_is_read_for_a_world_and_more_are_refused():
    assert parse_values("--world", "friction=0.8,weight=1.1") == {"friction": 0.8, "mass": 1.1}
    with pytest.raises(InvalidInputError, match="one value of friction"):
        parse_values("--world", "friction=0.8,0.9")


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_parameter_that_is_set_is_read_back_and_nothing_else_changes(name):
    world = draw(FIELD, SCENE, 3)
    value = 0.75 * PARAMETERS[name].read(world, SCENE) + 0.01
    changed_world = overridden(world, SCENE, {name: value})
    assert PARAMETERS[name].read(changed_world, SCENE) == value
    differ = {
        f.name for f in fields(world) if getattr(world, f.name) != getattr(changed_world, f.name)
    }
    assert differ == {PARAMETERS[name].field}


def test_hand_friction_is_that_of_the_hands_and_support_friction_the_rest():
    world = draw(FIELD, SCENE, 3)
    hands = overridden(world, SCENE, {"hand_friction": 0.5}).friction
    assert hands == (0.5, 0.5, *world.friction[2:])
    assert overridden(world, SCENE, {"support_friction": 0.5}).friction == (
        *world.friction[:2],
        0.5,
        0.5,
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"controllers": ()}, "one or more of robust, dynamic, margin"),
        ({"controllers": ("margin", "margin")}, "each once"),
        ({"controllers": ("pid",)}, "pid"),
        ({"preset": "moon"}, "nominal, lab, field, harsh"),
        ({"episodes": 0}, "episodes"),
        ({"episodes": 100_000}, "at most 100000 in all"),
        ({"seed": -1}, "seed"),
        ({"grid": (("mass", (1.0, -1.0)),)}, "world.mass"),
        ({"grid": (("dropped", (1.0,)),)}, "world.dropped"),
    ],
)
def test_a_sweep_that_cannot_be_is_refused(changes, said):
    with pytest.raises(InvalidInputError, match=said):
        short_sweep(**changes)


def test_seeds_and_points_of_the_grid_are_crossed_and_every_replay_differs():
    sweep = short_sweep(episodes=3, grid=(("mass", (0.9, 1.1)), ("com_x", (0.0, 0.01))))
    episodes = sweep.all_episodes()
    assert len(episodes) == 3 * 4 * 2
    assert {e.seed for e in episodes} == {5, 6, 7}
    assert len({e.name for e in episodes}) == len({sweep.replay(e) for e in episodes}) == 24
    assert sweep.world(episodes[-1]).mass == 1.1
    assert sweep.world(episodes[-1]).center_of_mass[0] == 0.01


# --- scores and maps ---


def row(controller, cause, seed, grip=50.0, mass=1.0, friction=1.0):
    return {
        "controller": controller,
        "seed": seed,
        "success": cause is None,
        "cause": cause,
        "verdict": "pass" if cause is None else "fail",
        "replay": f"fulcrum run --seed {seed}",
        "contacts.left.max_normal_n": grip,
        "contacts.right.max_normal_n": None if grip is None else grip + 1.0,
        "contacts.left.max_utilisation": 0.8,
        "contacts.right.max_utilisation": 0.6,
        "contacts.left.force_error_rms_n": 0.1,
        "contacts.right.force_error_rms_n": 0.3,
        "world.mass": mass,
        "world.friction": friction,
    }


def test_scores_count_successes_and_rank_causes():
    causes = [None] * 7 + ["lost left", "slip edge_left", "slip edge_left"]
    rows = [row("margin", cause, seed) for seed, cause in enumerate(causes)]
    rows += [row("paper", "error", seed, grip=None) for seed in range(2)]
    margin, paper = scores(pa.Table.from_pylist(rows), ("left", "right"))
    assert (margin.controller, margin.episodes, margin.successes) == ("margin", 10, 7)
    # Clopper and Pearson for 7 of 10, as tables have it.
    assert (round(margin.low, 4), round(margin.high, 4)) == (0.3475, 0.9333)
    assert [(c.cause, c.episodes, c.share) for c in margin.causes] == [
        ("slip edge_left", 2, 0.2),
        ("lost left", 1, 0.1),
    ]
    assert margin.causes[0].replay == "fulcrum run --seed 8"
    assert (margin.grip_n, margin.grip_max_n) == (51.0, 51.0)
    assert (margin.friction, margin.force_error_n) == (0.8, 0.3)
    assert (paper.rate, paper.low, paper.grip_n) == (0.0, 0.0, 0.0)


def test_the_map_is_green_where_episodes_succeed_and_red_where_not(tmp_path):
    grid = (("mass", (0.8, 1.2)), ("friction", (0.7, 1.3)))
    sweep = short_sweep(controllers=("margin",), grid=grid)
    rows = [
        row("margin", None if f > 1.0 else "lost left", 0, mass=m, friction=f)
        for m in (0.8, 1.2)
        for f in (0.7, 1.3)
    ]
    picture = tmp_path / "map.png"
    draw_map(pa.Table.from_pylist(rows), sweep, ("mass", "friction"), picture)
    colors = np.asarray(Image.open(picture).convert("RGB"), int)
    panel = colors[100:-80, 120:400]  # within the axes, colour bar left out
    high, low = panel[: len(panel) // 3], panel[-len(panel) // 3 :]
    excess = [np.median(part[..., 1] - part[..., 0]) for part in (high, low)]
    assert excess[0] > 30 > -30 > excess[1]


@pytest.mark.parametrize("masses", [(1.0, 1.0, 1.0), (0.8, 1.0, 1.1)])
def test_a_map_of_what_was_drawn_is_binned_even_if_it_is_the_same_everywhere(tmp_path, masses):
    rows = [row("margin", None, seed, mass=m) for seed, m in enumerate(masses)]
    picture = tmp_path / "map.png"
    sweep = short_sweep(controllers=("margin",))
    draw_map(pa.Table.from_pylist(rows), sweep, ("mass", "friction"), picture)
    assert Image.open(picture).size[0] > 300


# --- folders ---


def test_a_folder_of_another_sweep_is_refused_and_says_what_differs(tmp_path):
    Store(short_sweep(), tmp_path / "out").begin()
    Store(short_sweep(), tmp_path / "out")  # the same may go on
    with pytest.raises(InvalidInputError, match="other seed, grid"):
        Store(short_sweep(seed=6, grid=(("mass", (1.0,)),)), tmp_path / "out")


@pytest.mark.parametrize("content", ["", "[]", "{}", "\x00"])
def test_a_folder_whose_configuration_is_none_is_refused(tmp_path, content):
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(InvalidInputError, match="--out"):
        Store(short_sweep(), tmp_path)


def test_a_row_that_is_half_written_does_not_count(tmp_path):
    store = Store(short_sweep(), tmp_path / "out")
    store.begin()
    first, second, *_ = short_sweep().all_episodes()
    store.write(first, row("margin", None, 5))
    (tmp_path / "out" / "parts" / f"{second.name}.partial").write_bytes(b"PAR1")
    assert store.missing()[0].name == second.name
    assert store.read().to_pylist() == [row("margin", None, 5)]


# --- the command line ---

BAD = {
    "sweep": "episodes",
    "sweep sofa-tilt --episodes 1": "box-tilt",
    "sweep box-tilt": "episodes",
    "sweep box-tilt --episodes 0": "episodes",
    "sweep box-tilt --episodes 1 --preset moon": "nominal, lab, field, harsh",
    "sweep box-tilt --episodes 1 --controllers pid": "margin",
    "sweep box-tilt --episodes 1 --controllers ,": "margin",
    "sweep box-tilt --episodes 1 --grid mass": "--grid",
    "sweep box-tilt --episodes 1 --grid mass=-1": "world.mass",
    "sweep box-tilt --episodes 1 --map mass": "--map",
    "sweep box-tilt --episodes 1 --map mass,mass": "--map",
    "sweep box-tilt --episodes 1 --map mass,colour": "--map",
    "sweep box-tilt --episodes 1 --workers 0": "--workers",
    "sweep box-tilt --episodes 1 --workers 2 --scheduler tcp://a:1": "--workers",
    "sweep box-tilt --episodes 1 --scheduler nowhere://at-all": "--scheduler",
    "sweep box-tilt --episodes 1 --seed -1": "seed",
    "sweep box-tilt --episodes 1 --require 101": "--require",
    "sweep box-tilt --episodes 1 --out file": "--out",
    "sweep box-lift --episodes 1 --controllers margin": "cannot be held",
    "run box-tilt --preset moon": "nominal, lab, field, harsh",
    "run box-tilt --world mass=0": "world.mass",
    "run box-tilt --world mass=1,2": "one value",
    "run box-tilt --world colour=1": "--world",
}


@pytest.mark.parametrize("arguments", BAD)
def test_bad_input_gives_exit_code_2_one_line_and_no_files(
    arguments, tmp_path, monkeypatch, capsys
):
    (tmp_path / "file").touch()
    monkeypatch.chdir(tmp_path)
    assert main(arguments.split()) == 2
    output, errors = capsys.readouterr()
    assert output == ""
    assert len(errors.splitlines()) == 1
    assert BAD[arguments] in errors
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_every_scenario_that_can_be_held_can_be_swept():
    for name in ("box-tilt", "cylinder-tilt"):
        sweep = replace(short_sweep(), scenario=scenario(name))
        assert sweep.world(sweep.all_episodes()[0]).mass != 1.0
