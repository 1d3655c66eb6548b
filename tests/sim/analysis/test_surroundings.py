"""What `fulcrum check` finds in the object's way, and where it finds nothing under the object."""

import json
import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario, scenarios
from fulcrum.scenarios.reading.file import TEMPLATE, read
from fulcrum.sim.analysis.surroundings import _moved, _planes, surroundings
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.model.scene import _add_geom
from fulcrum.sim.scenario.phases import HOLD, REACH, TILT
from tests.helpers.scenario_files import ended, folder, said

__all__ = ["folder"]
BOX = scenario("box-tilt")
HOLDABLE = [s for s in (*scenarios().values(), read(TEMPLATE)) if s.holdable]


def on_table(reach):
    """The box on a table that reaches so far from the edge to the robot's side [m]."""
    (table,) = BOX.environment
    x, y, z = (0.35 + reach) / 2.0, 0.12, 0.02
    moved = replace(table, size=(x, y, z), pose=Pose((0.5 - reach + x, 0.0, -z)))
    return replace(BOX, environment=(moved,))


def turned(angle_deg, **changes):
    return replace(BOX, path=replace(BOX.path, angle_deg=angle_deg, **changes))


def before_wall(x, solid=True):
    """The box with a wall on the robot's side, which ends at x [m]."""
    wall = Geom("wall", "box", (0.01, 0.2, 0.5), Pose((x - 0.01, 0.0, 0.5)), solid=solid)
    return replace(BOX, environment=(*BOX.environment, wall))


@pytest.mark.parametrize("s", HOLDABLE, ids=[s.name for s in HOLDABLE])
def test_every_shipped_scene_fits_its_surroundings(s):
    assert surroundings(s).misfits == ()


# --- standing ---


# At the end the box stands on its 0.1 m side, its centre of mass 50 mm behind the edge. What is
# within a millimetre of toppling counts as standing, and half of one of touching.
@pytest.mark.parametrize("reach", [0.01, 0.03, 0.048])
def test_a_table_too_short_for_the_end_is_told_by_how_much(reach):
    found = surroundings(on_table(reach))
    assert found.misfits == (found.stand,)
    assert found.stand.tilt_deg == 90.0
    assert found.stand.off_m == pytest.approx(0.05 - reach, abs=1e-3)
    assert "towards -x; let table reach" in found.stand.text
    assert surroundings(replace(on_table(reach), phases=(*REACH, *TILT, *HOLD))).misfits == ()


@pytest.mark.parametrize("reach", [0.05, 0.06])
def test_a_table_that_ends_beyond_the_centre_of_mass_is_long_enough(reach):
    assert surroundings(on_table(reach)).misfits == ()


def test_the_centre_of_mass_counts_not_the_middle():
    # 40 mm lower in the object is 40 mm nearer to the edge when it stands.
    heavy_side = replace(BOX.object, center_of_mass=(0.0, 0.0, -0.04))
    assert surroundings(replace(on_table(0.03), object=heavy_side)).misfits == ()


def test_what_does_not_lie_flat_where_it_is_let_go_topples():
    stand = surroundings(turned(80.0)).stand
    # It touches along its edge alone: the centre of mass is 0.05 cos - 0.15 sin(10 deg) behind.
    angle = math.radians(80.0)
    off = 0.05 * math.sin(angle) - 0.15 * math.cos(angle)
    # Within a millimetre of the table are 6 mm of the box.
    assert stand.off_m == pytest.approx(off, abs=0.007)
    assert "let it lie flat" in stand.text and "reach" not in stand.text


def test_a_box_that_lies_half_beside_its_table_topples_before_it_is_held():
    (table,) = BOX.environment
    short = replace(table, size=(0.07, 0.12, 0.02), pose=Pose((0.57, 0.0, -0.02)))
    stand = surroundings(replace(BOX, environment=(short,))).stand
    # The table ends at 0.64 m, the centre of mass is at 0.65 m.
    assert (stand.tilt_deg, stand.off_m) == (0.0, pytest.approx(0.01, abs=1e-3))
    assert "towards +x" in stand.text


def test_an_object_over_the_gap_between_two_surfaces_stands():
    legs = [
        Geom(name, "box", (0.01, 0.12, 0.02), Pose((x, 0.0, -0.02)))
        for name, x in (("table", 0.50), ("far", 0.79))
    ]
    rest = replace(scenario("box-lift").rests[0], surface="far")
    hold = replace(BOX, environment=tuple(legs), phases=(*REACH, *TILT, *HOLD))
    assert surroundings(replace(hold, rests=(rest,))).misfits == ()
    assert surroundings(hold).stand.off_m == pytest.approx(0.14, abs=1e-3)


def test_without_anything_to_rest_on_nothing_is_under_it():
    floating = replace(BOX, supports=(), rests=())
    assert surroundings(floating).stand.off_m == math.inf
    assert "nothing that has friction is under it" in surroundings(floating).stand.text


# --- room ---


def test_a_box_turned_too_far_goes_into_its_table():
    room = surroundings(turned(100.0)).room
    # Its 0.1 m side, turned on by 10 deg.
    assert room.off_m == pytest.approx(0.1 * math.sin(math.radians(10.0)), abs=1e-5)
    assert "angle_deg of 90 at most" in room.text
    assert surroundings(turned(90.0)).room is None


def test_a_wall_that_the_box_swings_into_is_told_with_depth_and_tilt():
    # The box ends between 0.4 and 0.5 m; its near corner is 1 mm in at 0.5 - 0.1 sin = 0.409 m.
    room = surroundings(before_wall(0.41)).room
    assert room.off_m == pytest.approx(0.01, abs=1e-5)
    assert room.tilt_deg == pytest.approx(90.0)
    assert "goes 10.0 mm into wall at a tilt of 90.0 deg" in room.text
    entered = math.degrees(math.asin(0.91))
    assert f"angle_deg of {math.floor(entered)} at most" in room.text
    ended = replace(before_wall(0.41), path=turned(math.floor(entered)).path)
    assert surroundings(ended).room is None


def test_a_wall_that_is_far_enough_or_only_shown_is_in_nobodys_way():
    assert surroundings(before_wall(0.4)).misfits == ()
    assert surroundings(before_wall(0.41, solid=False)).misfits == ()


def test_a_wall_that_the_box_begins_in_is_to_be_moved():
    room = surroundings(before_wall(0.51)).room
    assert room.text.endswith("; move wall out of its way.")


def test_a_beam_overhead_is_reached_where_the_far_end_comes_up():
    beam = Geom("beam", "box", (0.5, 0.02, 0.01), Pose((0.5, 0.0, 0.26)))
    room = surroundings(replace(BOX, environment=(*BOX.environment, beam))).room
    # The upper far corner, 0.316 m from the edge, is 1 mm in at a height of 0.251 m.
    entered = math.degrees(math.asin(0.251 / math.hypot(0.3, 0.1)) - math.atan2(0.1, 0.3))
    assert f"angle_deg of {math.floor(entered)} at most" in room.text
    above = replace(beam, pose=Pose((0.5, 0.0, 0.33)))
    assert surroundings(replace(BOX, environment=(*BOX.environment, above))).room is None


# --- supports ---


@pytest.mark.parametrize("off", [0.004, -0.004])
def test_a_support_that_is_off_its_surface_at_the_start_is_told(off):
    start = replace(BOX.path.start, position=(0.65, 0.0, 0.05 + off))
    found = surroundings(turned(90.0, start=start)).supports
    assert (found.tilt_deg, found.off_m) == (0.0, pytest.approx(0.004, abs=1e-9))
    assert f"4.0 mm {'outside' if off > 0 else 'inside'} table" in found.text


def test_an_axis_beside_the_supports_moves_them():
    found = surroundings(turned(90.0, point_W=(0.5, 0.0, 0.02))).supports
    assert found.off_m == pytest.approx(0.02 * math.sqrt(2.0), abs=1e-6)
    assert found.tilt_deg == pytest.approx(90.0)
    assert surroundings(turned(90.0, point_W=(0.5, 0.3, 0.0))).supports is None


# --- geometry ---


SIZES = {
    "box": (0.1, 0.2, 0.3),
    "cylinder": (0.1, 0.2),
    "sphere": (0.1,),
    "capsule": (0.05, 0.1),
    "ellipsoid": (0.1, 0.2, 0.3),
    "mesh": (1.0,),
}
TETRAHEDRON = """
v 0 0 0
v 0.2 0 0
v 0 0.3 0
v 0 0 0.1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


@pytest.mark.parametrize("kind", SIZES)
def test_planes_around_a_geom_are_where_mujoco_finds_its_surface(kind, tmp_path):
    (tmp_path / "mesh.obj").write_text(TETRAHEDRON)
    file = str(tmp_path / "mesh.obj") if kind == "mesh" else None
    geom = Geom("thing", kind, SIZES[kind], file=file)
    spec = mujoco.MjSpec()
    _add_geom(spec, spec.worldbody.add_body(name="body", mocap=True), geom)
    spec.worldbody.add_geom(name="plane", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    ids = model.geom("plane").id, model.geom("thing").id
    for turn in Rotation.random(4, rng=np.random.default_rng(1)):
        data.mocap_pos[0] = (0.1, 0.2, 1.0)
        data.mocap_quat[0] = turn.as_quat(scalar_first=True)
        mujoco.mj_kinematics(model, data)
        height = mujoco.mj_geomDistance(model, data, *ids, 2.0, None)
        planes = _moved(_planes(geom), turn.as_matrix(), data.mocap_pos[0])
        free = [(None, None)] * 3
        lowest = linprog([0.0, 0.0, 1.0], planes[:, :3], -planes[:, 3], bounds=free).fun
        # Vertices have single precision; where they meet, planes around a round wall stand out by
        # up to a millimetre.
        assert lowest == pytest.approx(height, abs=1e-7 if kind in ("box", "mesh") else 1e-3)


# --- fulcrum check ---


def test_check_says_what_does_not_fit_in_one_sentence_each(folder, capsys):
    said(
        folder,
        ("size_m = [0.5, 0.24, 0.04]", "size_m = [0.37, 0.24, 0.04]"),
        ("position_m = [0.6, 0.0, 0.0]", "position_m = [0.665, 0.0, 0.0]"),
    )
    code, output, _ = ended("check said.toml --controller margin --out said", capsys)
    assert code == 1
    (sentence,) = json.loads((folder / "said" / "check.json").read_text())["misfits"]
    assert sentence in output.splitlines()
    assert sentence.startswith("box topples where it is let go at a tilt of 90 deg")
    assert 'after = "hold"' in sentence
