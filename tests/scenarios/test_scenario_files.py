"""Scenario files: those that ship, those that are broken, and what they can say."""

import json
import math
import re
import tomllib
from dataclasses import replace

import jsonschema
import pytest
import trimesh

from fulcrum.scenarios import scenario, scenarios
from fulcrum.scenarios.reading.file import SCHEMA, TEMPLATE, read, scene_files
from fulcrum.scenarios.reading.source import FileError
from fulcrum.scenarios.scene_files import schema_json
from tests.helpers.broken_files import BROKEN, GOOD
from tests.helpers.scenario_files import ended, folder, said

__all__ = ["folder"]

SHIPPED = {**scene_files(), "template": TEMPLATE}
each_file = pytest.mark.parametrize("file", SHIPPED.values(), ids=SHIPPED)


# --- the files that ship ---


@each_file
def test_a_shipped_file_keeps_to_the_published_schema(file):
    data = tomllib.loads(file.read_text())
    validator = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text()))
    assert list(validator.iter_errors(data)) == []
    data["sumary"] = data.pop("summary")
    assert list(validator.iter_errors(data))


def test_the_published_schema_is_that_of_the_models():
    assert SCHEMA.read_text() == schema_json()


@each_file
def test_a_shipped_file_names_its_schema_in_its_first_line(file):
    named = re.match(r"#:schema (\S+)\n", file.read_text())
    assert named and (file.parent / named[1]).resolve() == SCHEMA


def test_every_file_in_the_folder_is_a_scenario_and_nothing_else_is():
    assert set(scenarios()) == {file.stem for file in SCHEMA.parent.glob("*.toml")}
    assert {name: s.name for name, s in scenarios().items()} == {n: n for n in scenarios()}


def test_the_box_is_that_of_table_ii():
    # What the file's author may have got wrong: sides, signs and units.
    s = scenario("box-tilt")
    assert s.object.mass * 9.81 == pytest.approx(20.0)
    assert s.object.geoms[0].size == (0.15, 0.1, 0.05)
    assert [(h.p_OC_O[1], h.normal_O, h.tangent_O) for h in s.hands] == [
        (0.1, (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
        (-0.1, (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ]
    assert (s.path.point_W, s.path.axis_W) == ((0.5, 0.0, 0.0), (0.0, -1.0, 0.0))
    assert {p.normal_W for p in s.supports} == {(0.0, 0.0, 1.0)}
    assert s.robots[0].posture["right_w2"] == 1.03


# --- broken files ---


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_answered_with_file_key_and_remedy_in_one_sentence(case, folder, capsys):
    broken = BROKEN[case]
    assert broken.old in GOOD
    (folder / "bad.toml").write_text(GOOD.replace(broken.old, broken.new, 1))
    code, output, errors = ended("run bad.toml", capsys)
    assert (code, output) == (2, "")
    assert re.fullmatch(r"fulcrum: bad\.toml[: ].*: got .*; valid is .*\.\n", errors), errors
    place, _, valid = errors.partition("; valid is ")
    assert broken.key in place.partition(": got ")[0]
    assert broken.remedy in valid


def test_the_good_file_is_not_answered_so(folder):
    assert scenario("good.toml") == replace(scenario("good.toml"), name="good")


@pytest.mark.parametrize("case", BROKEN)
def test_the_line_is_that_of_the_change(case, folder):
    broken = BROKEN[case]
    (folder / "bad.toml").write_text(GOOD.replace(broken.old, broken.new, 1))
    with pytest.raises(FileError) as refused:
        scenario("bad.toml")
    line = refused.value.line
    if line is None:  # what is missing from the top has none
        assert case == "empty file"
        return
    text = (folder / "bad.toml").read_text().splitlines()[line - 1]
    last = refused.value.key.rpartition(".")[2].partition("[")[0]
    assert last in text or text.startswith("[") or not last


# --- what a file can say ---


def test_mass_is_said_in_three_ways(folder):
    weight, volume = "weight_n = 20.0", 0.3 * 0.2 * 0.1
    assert said(folder).object.mass == 20.0 / 9.81
    assert said(folder, (weight, "mass_kg = 3")).object.mass == 3.0
    dense = said(folder, (weight, "density_kg_per_m3 = 500")).object
    assert dense.mass == pytest.approx(500 * volume)
    assert dense.inertia == pytest.approx([3.0 / 12 * s for s in (0.05, 0.1, 0.13)])


def test_centre_of_mass_and_inertia_come_from_the_shape_or_from_the_file(folder):
    own = "weight_n = 20\ncenter_of_mass_m = [0, 0, 0.01]\ninertia_kg_m2 = [1, 2, 2.5]"
    thing = said(folder, ("weight_n = 20.0", own)).object
    assert (thing.center_of_mass, thing.inertia) == ((0.0, 0.0, 0.01), (1.0, 2.0, 2.5))
    assert said(folder).object.center_of_mass == (0.0, 0.0, 0.0)


def test_a_place_on_a_face_is_the_point_that_it_stands_for(folder):
    point = ('face = "+y"\nat = [0.5, 0.75]', "point_m = [0.075, 0.1, 0]")
    by_face, by_point = said(folder).hands[0], said(folder, point).hands[0]
    assert by_face.p_OC_O == pytest.approx(by_point.p_OC_O)
    assert (by_face.normal_O, by_face.tangent_O) == (by_point.normal_O, by_point.tangent_O)


def test_postures_are_in_degrees_or_radians(folder):
    degrees = f"[robots.posture_deg]\nleft_s0 = {math.degrees(-0.06)}\n\n[path]"
    posture = said(folder, ("left_s0 = -0.06\n", ""), ("[path]", degrees)).robots[0].posture
    assert posture == pytest.approx(said(folder).robots[0].posture)


def test_limits_base_and_prefix_of_a_robot(folder):
    limits = (
        'model = "baxter"\nprefix = "b_"\nposition_m = [0, 0, 0.1]\nrpy_deg = [0, 0, 90]\n'
        "torque_limit_nm = { left_s0 = 20 }\nspeed_limit_rad_s = { left_s1 = 0.5 }"
    )
    robot = said(folder, ('model = "baxter"', limits)).robots[0]
    assert (robot.prefix, robot.base.position) == ("b_", (0.0, 0.0, 0.1))
    assert robot.base.quaternion == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    assert (robot.torque_limits, robot.speed_limits) == ({"left_s0": 20.0}, {"left_s1": 0.5})


def test_a_wall_is_a_support_with_the_normal_of_its_front(folder):
    wall = (
        '[environment.wall]\nkind = "wall"\nsize_m = [0.1, 1, 1]\nposition_m = [0.8, 0, 0.5]\n'
        "friction = { mu = 0.5 }\n\n[environment.table]"
    )
    support = '[supports.back]\nsurface = "wall"\ncorner = "+x +y -z"\n\n[supports.edge_left]'
    s = said(folder, ("[environment.table]", wall), ("[supports.edge_left]", support))
    back = s.supports[0]
    assert (back.normal_W, back.tangent_W, back.friction.mu) == ((-1, 0, 0), (0, 0, 1), 0.5)
    assert s.environment[0].pose.position == pytest.approx((0.85, 0.0, 0.5))
    # Where no support stands on it the object may lie on it.
    resting = said(folder, ("[environment.table]", wall)).rests
    assert [(rest.surface, rest.friction.mu) for rest in resting] == [("wall", 0.5)]
    assert said(folder).rests == ()


def test_a_tilt_about_an_axis_is_that_about_the_edge_on_it(folder):
    edge = 'edge = ["-x +y -z", "-x -y -z"]'
    axis = said(folder, (edge, "point_m = [0.5, 0, 0]\naxis = [0, -2, 0]")).path
    assert axis == said(folder).path
    other = said(folder, (edge, 'edge = ["-x -y -z", "-x +y -z"]')).path
    assert other.axis_W == (0.0, 1.0, 0.0)


def test_a_screw_advances(folder):
    screw = 'kind = "screw"\npitch_m_per_rad = 0.01\ntravel_m = [0, 0, 0.1]\nangle_deg'
    path = said(folder, ("angle_deg", screw)).path
    assert (path.pitch, path.travel) == (0.01, (0.0, 0.0, 0.1))


def test_phases_are_those_of_the_manoeuvre_or_said_one_by_one(folder):
    own = (
        '[[manoeuvre.phases]]\nname = "turn"\nduration_s = 2\ntilt = 1\ngap_m = 0\ngrip = 1\n'
        "[tolerances]\nslip_mm = 0.3\n[control]\nobjective = 'max-torque'\n"
    )
    s = said(folder, ('[manoeuvre]\ntilt_s = 8.0\nafter = "leave"', own))
    assert [(phase.name, phase.duration_s) for phase in s.phases] == [("turn", 2.0)]
    assert (s.tolerances.slip_mm, s.control.objective) == (0.3, "max-torque")
    slow = ("tilt_s = 8.0", "approach_s = 2\ntouch_s = 3\ngrip_s = 4\ntilt_s = 5")
    assert [p.duration_s for p in said(folder, slow).phases[:4]] == [2.0, 3.0, 4.0, 5.0]
    names = [phase.name for phase in said(folder).phases]
    held = [p.name for p in said(folder, ('after = "leave"', 'after = "hold"')).phases]
    assert (names[-1], held[-1]) == ("stand", "hold")


# --- files beside it ---


def test_a_mesh_beside_the_file_is_read_and_one_elsewhere_where_it_is_allowed(folder, capsys):
    trimesh.creation.box((0.3, 0.2, 0.1)).export(folder / "box.stl")
    trimesh.creation.box((0.3, 0.2, 0.1)).export(folder.parent / "box.stl")
    box = 'shape = "box"\nsize_m = [0.3, 0.2, 0.1]'
    changes = [
        ('face = "+y"\nat = [0.5, 0.75]\nmay_touch = ["+y"]', "point_m = [0, 0.1, 0]"),
        ('face = "-y"\nat = [0.5, 0.75]\nmay_touch = ["-y"]', "point_m = [0, -0.1, 0]"),
        ('corner = "-x +y -z"', "point_m = [-0.15, 0.1, -0.05]"),
        ('corner = "-x -y -z"', "point_m = [-0.15, -0.1, -0.05]"),
        ('edge = ["-x +y -z", "-x -y -z"]', "point_m = [0.5, 0, 0]\naxis = [0, -1, 0]"),
    ]
    mesh = said(folder, *changes, (box, 'shape = "mesh"\nfile = "box.stl"'))
    assert mesh.object.inertia == pytest.approx(said(folder).object.inertia, rel=1e-6)
    with pytest.raises(FileError, match="--allow-path"):
        said(folder, *changes, (box, 'shape = "mesh"\nfile = "../box.stl"'))
    assert read(folder / "said.toml", (folder.parent,)).object.mass == mesh.object.mass
    code, _, errors = ended("explain said.toml --allow-path .. --tilt-deg 100", capsys)
    assert (code, "tilt: got 100" in errors) == (2, True)


def test_an_edge_of_a_shape_without_corners_is_told_to_use_points(folder):
    changes = [
        (
            'shape = "box"\nsize_m = [0.3, 0.2, 0.1]',
            'shape = "cylinder"\nradius_m = 0.1\nlength_m = 0.1',
        ),
        ('face = "+y"\nat = [0.5, 0.75]\nmay_touch = ["+y"]', "point_m = [0, 0.1, 0]"),
        ('face = "-y"\nat = [0.5, 0.75]\nmay_touch = ["-y"]', "point_m = [0, -0.1, 0]"),
        ('corner = "-x +y -z"', "point_m = [0, 0.1, -0.05]"),
        ('corner = "-x -y -z"', "point_m = [0, -0.1, -0.05]"),
    ]
    with pytest.raises(FileError, match=r"path\.edge: .* point_m and axis, as only a box has"):
        said(folder, *changes)


def test_a_byte_order_mark_is_no_part_of_the_file(folder):
    (folder / "marked.toml").write_text(GOOD, encoding="utf-8-sig")
    assert replace(read(folder / "marked.toml"), name="good") == read(folder / "good.toml")
    (folder / "marked.toml").write_text(GOOD.replace("angle_deg", "angel"), encoding="utf-8-sig")
    with pytest.raises(FileError, match=r"marked\.toml:\d+: path\.angel"):
        read(folder / "marked.toml")


def test_a_robot_whose_package_reaches_out_of_the_folder_is_refused(folder):
    (folder.parent / "package.xml").write_text("<package><name>mine</name></package>")
    (folder / "arm.urdf").write_text("<robot/>")
    own = ('model = "baxter"', 'model = "arm.urdf"')
    with pytest.raises(FileError, match="allowed with --allow-path"):
        said(folder, own)
    assert read(folder / "said.toml", (folder.parent,)).robots[0].model.endswith("arm.urdf")
    (folder / "package.xml").write_text("<package><name>arm</name></package>")
    assert said(folder, own).robots[0].model.endswith("arm.urdf")


def test_a_post_is_a_cylinder_below_its_top(folder):
    post = (
        '[environment.post]\nkind = "post"\nsize_m = [0.1, 0.6]\nposition_m = [0.65, 0, 0]\n'
        "friction = { mu = 0.5 }\n\n[environment.table]"
    )
    support = (
        '[supports.on_post]\nsurface = "post"\npoint_m = [0, 0, -0.05]\n\n[supports.edge_left]'
    )
    s = said(folder, ("[environment.table]", post), ("[supports.edge_left]", support))
    geom = s.environment[0]
    assert (geom.kind, geom.size, geom.pose.position[2]) == ("cylinder", (0.05, 0.3), -0.3)
    assert s.supports[0].normal_W == (0.0, 0.0, 1.0)
    with pytest.raises(FileError, match="mm off post"):
        said(
            folder,
            ("[environment.table]", post),
            ("[supports.edge_left]", support.replace("[0, 0, -0.05]", "[0.1, 0, -0.05]")),
        )


def test_poses_are_passed_from_the_start_on(folder):
    # The corner at the origin of the turns is the box's edge.
    turned = (
        '[path]\nkind = "poses"\n\n[[path.poses]]\nposition_m = [0.45, 0.0, 0.15]\n'
        "rpy_deg = [0, -90, 0]\n\n[manoeuvre]"
    )
    old = '[path]\nedge = ["-x +y -z", "-x -y -z"]\nangle_deg = 90.0\n\n[manoeuvre]'
    path = said(folder, (old, turned)).path
    assert path.angle_deg == pytest.approx(90.0)
    assert path.point_W == pytest.approx((0.5, 0.0, 0.0), abs=1e-9)
    scenario("said.toml")
    # Poses that lift the edge are refused, as are those that do not turn.
    lifting = turned.replace("[0.45, 0.0, 0.15]", "[0.45, 0.0, 0.25]")
    for new, answer in ((lifting, "edge_left"), (turned.replace("-90", "0"), "a turn of")):
        with pytest.raises(FileError, match=answer) as refused:
            said(folder, (old, new))
            scenario("said.toml")
        assert refused.value.line is not None
