"""Shapes have the volume and inertia that MuJoCo finds, and places that lie on their faces."""

import json
import math
from dataclasses import asdict, replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario, scenarios
from fulcrum.sim.geometry.shapes import Box, Cylinder, HollowCylinder, MeshShape
from fulcrum.synthesis import InvalidInputError

# Lengths are of the order of 1 m: a few roundings of 2e-16 each.
ROUNDING = 1e-14

BOX = scenario("box-tilt")
SHAPES = {
    "cuboid": Box((0.3, 0.2, 0.1)),
    **{f"cylinder {axis}": Cylinder(0.07, 0.3, axis) for axis in "xyz"},
    **{f"tube {axis}": HollowCylinder(0.18, 0.15, 0.5, axis) for axis in "xyz"},
}
each_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
shares = st.floats(0.0, 1.0)
quick = settings(derandomize=True, deadline=None, max_examples=25)


def mujoco_inertia(*geoms):
    """Mass and inertia matrix that MuJoCo finds for geoms of density 1000 about the origin."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    for kind, size, density in geoms:
        body.add_geom(type=kind, size=size, density=density)
    model = spec.compile()
    R = Rotation.from_quat(model.body_iquat[1], scalar_first=True).as_matrix()
    return model.body_mass[1], R @ np.diag(model.body_inertia[1]) @ R.T


# --- volume, inertia, geoms ---


@each_shape
def test_volume_and_inertia_are_those_that_mujoco_finds(shape):
    kinds = mujoco.mjtGeom
    if isinstance(shape, Box):
        mass, inertia = mujoco_inertia((kinds.mjGEOM_BOX, np.array(shape.size) / 2, 1000.0))
    else:
        # MuJoCo knows no hollow cylinder: what is bored out is the difference of two.
        inner, outer = shape._radii
        mass, inertia = mujoco_inertia(
            (kinds.mjGEOM_CYLINDER, [outer, shape.length / 2, 0], 1000.0)
        )
        if inner:
            bored = mujoco_inertia((kinds.mjGEOM_CYLINDER, [inner, shape.length / 2, 0], 1000.0))
            mass, inertia = mass - bored[0], inertia - bored[1]
        own = "xyz".index(shape.axis)
        inertia = np.diag(np.roll(np.diag(inertia), own + 1))
    assert shape.volume == pytest.approx(mass / 1000.0, rel=1e-12)
    np.testing.assert_allclose(np.diag(shape.inertia(mass)), inertia, rtol=1e-12, atol=1e-12)
    # A hundredth more of any length is caught.
    assert shape.scaled(1.01).inertia(mass) != pytest.approx(np.diag(inertia), rel=1e-3)


def test_the_shipped_objects_are_as_they_were_before_there_were_shapes():
    twelfth = BOX.object.mass / 12.0
    assert BOX.object.inertia == (
        twelfth * (0.2**2 + 0.1**2),
        twelfth * (0.3**2 + 0.1**2),
        twelfth * (0.3**2 + 0.2**2),
    )
    cylinder = scenario("cylinder-tilt").object
    rim, wall, first = cylinder.geoms[:3]
    assert (rim.name, rim.size, rim.solid) == ("rim", (0.18, 0.25), False)
    assert wall.pose.position == (0.0, 0.0, (0.18 + 0.15) / 2) and wall.name == "wall"
    assert first.pose.position[1] == -(0.18 + 0.15) / 2 * math.sin(2 * math.pi / 32)


@pytest.mark.parametrize("axis", "xyz")
def test_the_staves_of_a_tube_lie_on_its_walls_about_its_axis(axis):
    shape = HollowCylinder(0.18, 0.15, 0.5, axis)
    for face, side in (("outside", 1.0), ("inside", -1.0)):
        for u in np.linspace(0.0, 1.0, 33):
            place = shape.place(face, float(u), 0.7)
            (stave,) = (
                g for g in shape.geoms("tube") if g.name == shape.touched("tube", place.point)
            )
            turn = Rotation.from_quat(stave.pose.quaternion, scalar_first=True)
            p = turn.inv().apply(np.subtract(place.point, stave.pose.position))
            own = "xyz".index(axis)
            expected = np.zeros(3)
            expected[own], expected[(own + 2) % 3] = 0.2 * 0.5, side * 0.015
            np.testing.assert_allclose(p, expected, rtol=0, atol=ROUNDING)


# --- places ---


@each_shape
@quick
@given(u=shares, v=shares, depth=st.floats(-0.01, 0.01))
def test_a_place_is_the_closest_point_to_what_lies_over_or_under_it(shape, u, v, depth):
    for face in shape.faces:
        # Near edges other faces are closer.
        place = shape.place(face, 0.1 + 0.8 * u, 0.2 + 0.6 * v)
        assert np.linalg.norm(place.normal) == pytest.approx(1.0, abs=ROUNDING)
        off = np.add(place.point, depth * np.array(place.normal))
        if isinstance(shape, HollowCylinder):  # its wall is 30 mm thick
            off = np.add(place.point, 0.1 * depth * np.array(place.normal))
        found = shape.closest(tuple(off))
        assert found.face == face
        np.testing.assert_allclose(found.point, place.point, rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(found.normal, place.normal, rtol=0, atol=ROUNDING)


@each_shape
@quick
@given(st.tuples(*3 * [st.floats(-0.5, 0.5)]), st.integers(0, 1000))
def test_no_point_of_the_surface_is_closer_than_the_closest(shape, p, seed):
    found = shape.closest(p)
    assert found.face in shape.faces
    random = np.random.default_rng(seed)
    for face in shape.faces:
        for u, v in random.uniform(size=(10, 2)).tolist():
            other = shape.place(face, u, v)
            assert math.dist(found.point, p) <= math.dist(other.point, p) + ROUNDING
    # The found point is on the surface: it is its own closest.
    assert math.dist(shape.closest(found.point).point, found.point) < ROUNDING


def test_normals_point_into_the_object():
    for shape in SHAPES.values():
        for face in shape.faces:
            place = shape.place(face, 0.3, 0.5)
            inside = np.add(place.point, 0.001 * np.array(place.normal))
            outside = np.subtract(place.point, 0.001 * np.array(place.normal))
            if face != "inside":
                assert np.linalg.norm(inside) < np.linalg.norm(outside)
            else:
                across = np.delete(inside, "xyz".index(shape.axis))
                assert 0.15 < np.linalg.norm(across) < 0.18


@pytest.mark.parametrize(
    ("face", "u", "v", "message"),
    [
        ("+w", 0.5, 0.5, r"face: got \+w; valid is one of \+x, -x,"),
        ("+x", 1.1, 0.5, r"face \+x: u: got 1.1; valid is in \[0, 1\]"),
        ("+x", 0.5, math.nan, r"face \+x: v: got nan"),
    ],
)
def test_a_place_that_is_none_is_refused(face, u, v, message):
    with pytest.raises(InvalidInputError, match=message):
        SHAPES["cuboid"].place(face, u, v)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Box((0.3, 0.0, 0.1)), r"shape\.size: got 0.0"),
        (lambda: Box((0.3, 0.1)), r"shape\.size: .*valid is 3 numbers"),
        (lambda: Cylinder(-0.1, 0.3), r"shape\.radius: got -0.1"),
        (lambda: Cylinder(0.1, math.nan), r"shape\.length: got nan"),
        (lambda: Cylinder(0.1, 0.3, "w"), r"shape\.axis: got w; valid is one of x, y, z"),
        (lambda: HollowCylinder(0.1, 0.1, 0.3), r"inner_radius: got 0.1; valid is less than"),
        (lambda: HollowCylinder(0.1, -0.1, 0.3), r"inner_radius: got -0.1"),
        (lambda: HollowCylinder(0.1, 0.05, math.inf), r"shape\.length: got inf"),
        (lambda: MeshShape("nowhere.stl"), r"shape\.file: got nowhere.stl \(No such file"),
        (lambda: MeshShape("nowhere.dae"), r"valid is a file that ends in one of \.obj"),
        (lambda: MeshShape("nowhere.stl", 0.0), r"shape\.scale: got 0.0"),
        (lambda: SHAPES["cuboid"].closest((0.0, math.nan, 0.0)), r"p_O: got"),
    ],
)
def test_a_senseless_shape_is_refused_by_name(make, message):
    with pytest.raises(InvalidInputError, match=message):
        make()


def test_an_object_s_shape_is_part_of_a_run_s_configuration():
    text = json.dumps(asdict(BOX.object))
    assert json.loads(text)["shape"] == {"size": [0.3, 0.2, 0.1]}


# --- the scenes ---


def off_surface(scene):
    """How far each contact is from its object's surface [m], and each hand's normal from it."""
    shape = scene.object.shape
    places = {h.name: h.p_OC_O for h in scene.hands} | {s.name: s.p_OP_O for s in scene.supports}
    off = [math.dist(shape.closest(p).point, p) for p in places.values()]
    return max(off), max(math.dist(shape.closest(h.p_OC_O).normal, h.normal_O) for h in scene.hands)


@pytest.mark.parametrize("name", scenarios())
def test_contacts_lie_on_the_object_s_surface(name):
    scene = scenario(name)
    distance, turn = off_surface(scene)
    assert distance < ROUNDING and turn < ROUNDING
    first = scene.hands[0]
    x, y, z = np.subtract(first.p_OC_O, 1e-3 * np.array(first.normal_O)).tolist()
    hands = (replace(first, p_OC_O=(x, y, z)), *scene.hands[1:])
    assert off_surface(replace(scene, hands=hands))[0] == pytest.approx(1e-3, abs=ROUNDING)
