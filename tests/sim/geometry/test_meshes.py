"""Mesh files: what they give, which are refused, and that plant, plan and recording know them."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.object import homogeneous
from fulcrum.sim.geometry.shapes import Box, Cylinder, HollowCylinder, MeshShape
from fulcrum.sim.model.inertia import inertial_wrenches
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.scene import compose
from fulcrum.sim.recording.scenery import Scenery
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError

BOX = scenario("box-tilt")
CUBOID, CYLINDER = Box((0.3, 0.2, 0.1)), Cylinder(0.07, 0.3)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Mesh files by name; an L, whose notch is a hollow, a turned cuboid, and a cylinder."""
    folder = tmp_path_factory.mktemp("meshes")
    turned = trimesh.creation.box((0.3, 0.2, 0.1))
    turn = trimesh.transformations.rotation_matrix(0.3, (1.0, 2.0, 3.0))
    turn[:3, 3] = 0.1, -0.2, 0.3
    turned.apply_transform(turn)
    # The outline of the L, drawn out along y.
    outline = np.array([[-15, -5], [15, -5], [15, 5], [-5, 5], [-5, 25], [-15, 25]]) / 100.0
    meshes = {
        "l": _prism(outline, 0.1),
        "turned": turned,
        "cylinder": trimesh.creation.cylinder(0.07, 0.3, sections=2000),
        "cuboid": trimesh.creation.box((0.3, 0.2, 0.1)),
    }
    for name, mesh in meshes.items():
        mesh.export(folder / f"{name}.stl")
    return folder


def _prism(outline, width):
    """A closed mesh of a star-shaped outline about its first reflex corner, in x and z."""
    n, center = len(outline), 3
    front = np.column_stack([outline[:, 0], np.full(n, -width / 2), outline[:, 1]])
    back = np.add(front, [0.0, width, 0.0])
    fan = [(center, (center + i) % n, (center + i + 1) % n) for i in range(1, n - 1)]
    sides = [(i, (i + 1) % n) for i in range(n)]
    faces = [*fan, *((a + n, c + n, b + n) for a, b, c in fan)]
    for a, b in sides:
        faces += [(a, a + n, b), (b, a + n, b + n)]
    mesh = trimesh.Trimesh(np.vstack([front, back]), faces, process=False)
    mesh.fix_normals()
    return mesh


# --- meshes ---


def test_a_mesh_has_the_volume_inertia_and_places_of_what_it_approximates(files):
    shape, exact = MeshShape(str(files / "cylinder.stl")), CYLINDER
    # 2,000 sides: area is less by (2 pi / 2000)^2 / 6 = 1.6e-6; STL has single precision.
    assert shape.volume == pytest.approx(exact.volume, rel=3e-6)
    assert sorted(shape.inertia(3.0)) == pytest.approx(sorted(exact.inertia(3.0)), rel=5e-6)
    assert shape.closest((0.0, 0.2, 0.01)).point == pytest.approx((0.0, 0.07, 0.01), abs=1e-6)
    assert shape.closest((0.0, 0.2, 0.01)).normal == pytest.approx((0.0, -1.0, 0.0), abs=2e-3)
    place = shape.place("surface", 0.25, 0.5)
    assert place.point == pytest.approx((0.0, 0.07, 0.0), abs=1e-6)
    assert shape.place("surface", 0.3, 1.0).point == pytest.approx((0.0, 0.0, 0.15), abs=1e-6)
    # Scaled it is larger, and not as heavy for the same density.
    assert shape.scaled(2.0).volume == pytest.approx(8.0 * shape.volume, rel=1e-9)


def test_a_turned_mesh_keeps_its_moments_and_says_where_their_axes_are(files):
    shape, exact = MeshShape(str(files / "turned.stl")), CUBOID
    assert sorted(shape.inertia(2.0)) == pytest.approx(sorted(exact.inertia(2.0)), rel=1e-6)
    assert shape.center == pytest.approx((0.1, -0.2, 0.3), abs=1e-7)
    R_OI = Rotation.from_quat(shape.principal_axes, scalar_first=True).as_matrix()
    turn = Rotation.from_rotvec(0.3 * np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0)).as_matrix()
    inertia = R_OI @ np.diag(shape.inertia(2.0)) @ R_OI.T
    expected = turn @ np.diag(exact.inertia(2.0)) @ turn.T
    np.testing.assert_allclose(inertia, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    assert np.abs(np.diag(shape.inertia(2.0)) - expected).max() > 1e-4


def test_plant_and_plan_know_a_turned_inertia(files):
    """MuJoCo's inverse dynamics and ours agree on what accelerates an object with turned axes."""
    thing = homogeneous("box", MeshShape(str(files / "turned.stl")), 2.0)
    model = compose(replace(BOX, object=thing)).compile()
    body = model.body("box")
    R = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
    inertia = R @ np.diag(body.inertia) @ R.T
    path = ScrewPath(BOX.path)
    w_a, w_b = inertial_wrenches(replace(BOX, object=thing), path, 0.4)
    omega = path.pose(0.4)[0].T @ path.direction
    center = np.array(thing.center_of_mass)
    for wrench, moment in ((w_a, inertia @ omega), (w_b, np.cross(omega, inertia @ omega))):
        found = wrench[3:] - np.cross(center, wrench[:3])
        np.testing.assert_allclose(found, moment, rtol=0, atol=1e-12)
    # With axes that are believed to be the object's own it is another moment.
    straight = replace(thing, principal_axes=(1.0, 0.0, 0.0, 0.0))
    other, _ = inertial_wrenches(replace(BOX, object=straight), path, 0.4)
    assert np.abs(other - w_a).max() > 1e-4


def broken_file(folder, kind):
    """A mesh file with a defect, and what its refusal says."""
    path, mesh = folder / f"{kind}.stl", trimesh.creation.box((0.3, 0.2, 0.1))
    match kind:
        case "empty":
            path.write_bytes(b"")
            return path, "which is empty; valid is a mesh file with faces"
        case "garbled":
            path.write_bytes(b"solid \x00 no mesh")
            return path, "valid is a mesh file with faces"
        case "open":
            mesh.update_faces(np.arange(12) != 5)
            says = "holes .*; valid is a closed surface"
        case "inside out":
            mesh.invert()
            says = "encloses -0.006 m.3; valid is faces counter-clockwise as seen from outside"
        case "flat":
            mesh.vertices[:, 2] = 0.0
            says = "valid is"
        case "nan":
            path = path.with_suffix(".obj")
            lines = mesh.export(file_type="obj").splitlines()
            i = next(i for i, line in enumerate(lines) if line.startswith("v "))
            path.write_text("\n".join([*lines[:i], "v nan 0 0", *lines[i + 1 :]]))
            return path, "valid is"
    mesh.export(path)
    return path, says


@pytest.mark.parametrize("kind", ["empty", "garbled", "open", "inside out", "flat", "nan"])
def test_a_broken_mesh_file_is_refused_in_a_sentence_that_names_it(tmp_path, kind):
    path, says = broken_file(tmp_path, kind)
    with pytest.raises(InvalidInputError, match=rf"shape\.file: got .*{kind}.*{says}") as caught:
        MeshShape(str(path))
    assert "\n" not in str(caught.value)


def test_a_mesh_reads_no_other_file(tmp_path):
    text = trimesh.creation.box((0.3, 0.2, 0.1)).export(file_type="obj")
    path = tmp_path / "cuboid.obj"
    path.write_text(f"mtllib ../secret.mtl\n{text}")
    (tmp_path.parent / "secret.mtl").mkdir(exist_ok=True)  # would raise where it is read
    assert MeshShape(str(path)).volume == pytest.approx(0.006, rel=1e-6)


def holding(shape, *places):
    """The box scene with another object, held at places."""
    thing = homogeneous("box", shape, 2.0)
    hands = tuple(
        replace(hand, p_OC_O=place) for hand, place in zip(BOX.hands, places, strict=True)
    )
    return replace(BOX, object=thing, hands=hands, supports=())


def test_a_contact_in_a_hollow_is_refused_and_one_on_the_hull_is_not(files):
    shape = MeshShape(str(files / "l.stl"))
    on_hull = (0.1, 0.05, 0.0), (0.1, -0.05, 0.0)
    compose(holding(shape, *on_hull))
    in_notch = shape.closest((0.1, 0.0, 0.06))
    assert in_notch.point == pytest.approx((0.1, 0.0, 0.05), abs=1e-7)
    message = r"right\.p_OC_O: got \(0\.1, .* inside the convex hull of box, .*: it is 35\.4 mm"
    with pytest.raises(InvalidInputError, match=message):
        compose(holding(shape, on_hull[0], in_notch.point))
    # 0.9 mm inside the hull is let through.
    compose(holding(shape, on_hull[0], (0.1, -0.0491, 0.0)))


def test_a_mesh_touches_as_the_shape_that_it_is(files):
    mesh = holding(MeshShape(str(files / "cuboid.stl")), *(h.p_OC_O for h in BOX.hands))
    models = [compose(s).compile() for s in (mesh, replace(BOX, supports=()))]
    found = []
    for model in models:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        pads = [model.geom(f"{hand.name}_tip").id for hand in BOX.hands]
        thing = model.geom("box").id
        found.append([mujoco.mj_geomDistance(model, data, pad, thing, 2.0, None) for pad in pads])
    # MuJoCo's tolerance for convex collisions is 1e-6 m.
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-5)
    assert min(found[1]) > 0.01


def test_recordings_show_a_mesh_where_it_is(files):
    class Log:
        def __init__(self):
            self.shown = {}

        def log(self, path, *components, static):
            self.shown[path] = components[0]

    thing = homogeneous("box", MeshShape(str(files / "turned.stl")), 2.0)
    chosen, log = replace(BOX, object=thing, supports=()), Log()
    Scenery(chosen, RobotModel(chosen).joints).log_shapes(log)
    points = np.array(log.shown["world/box/box"].vertex_positions.as_arrow_array().flatten())
    corners = np.unique(np.round(points.reshape(-1, 3).astype(float), 5), axis=0)
    expected = trimesh.load_mesh(files / "turned.stl").vertices
    assert len(corners) == 8
    gaps = np.linalg.norm(corners[:, None] - expected, axis=2).min(axis=1)
    assert gaps.max() < 2e-5  # of rounding to five digits


def test_a_larger_world_has_a_larger_shape(files):
    mesh = MeshShape(str(files / "cuboid.stl"))
    for shape in (CUBOID, CYLINDER, HollowCylinder(0.18, 0.15, 0.5, "x"), mesh):
        chosen = replace(BOX, object=homogeneous("box", shape, 2.0), hands=(), supports=())
        thing = World(size=1.1).truth(chosen).object
        assert thing.shape == shape.scaled(1.1) != shape
        sizes = zip(thing.geoms, thing.shape.geoms("box"), strict=True)
        for geom, other in sizes:
            assert geom.size == pytest.approx(other.size, rel=1e-12)


@pytest.mark.parametrize(("kind", "file"), [("mesh", None), ("sphere", "a.stl")])
def test_a_geom_with_a_file_is_a_mesh_and_no_other_is(kind, file):
    with pytest.raises(InvalidInputError, match=r"thing\.file: .*a file for the kind mesh"):
        Geom("thing", kind, (1.0,), file=file)
