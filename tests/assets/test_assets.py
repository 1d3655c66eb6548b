"""Baxter and its pad are what the official description says, in MuJoCo and in Pinocchio alike."""

import xml.etree.ElementTree as ET
from collections.abc import Callable

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from fulcrum.assets import asset_path, description_path, velocity_limits
from fulcrum.assets.from_urdf import GRIPPER_JOINTS, RECIPES, shipped_mjcf, urdf_of
from fulcrum.assets.urdf import without_branches
from fulcrum.assets.visuals import load_visuals

URDF = urdf_of("baxter")
FILE = description_path("baxter_description/urdf/baxter.urdf")
LINKS = [link.attrib["name"] for link in ET.fromstring(URDF).findall("link")]
HANDS = ("left_hand_link", "right_hand_link")
# Both libraries compute in double precision; the largest number compared is ~1e2, and a chain of
# ten frames loses a few digits of 1e-16 * 1e2. Measured: 4e-14.
ROUNDING = 1e-12

Facts = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def mj_model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(asset_path("baxter.xml")))


@pytest.fixture(scope="module")
def pin_model() -> pin.Model:
    return pin.buildModelFromXML(URDF)


@pytest.fixture(scope="module")
def pin_model_from_mjcf() -> pin.Model:
    return pin.buildModelFromMJCF(str(asset_path("baxter.xml")))


def joint_names(model: mujoco.MjModel) -> list[str]:
    """Canonical order of joints, in which all facts are stated."""
    return sorted(model.joint(i).name for i in range(model.njnt))


def sampled_positions(model: mujoco.MjModel, count: int = 20) -> np.ndarray:
    """(count, njnt) joint positions within their limits [rad], in canonical order."""
    rng = np.random.default_rng(0)
    ranges = np.array([model.joint(name).range for name in joint_names(model)])
    return rng.uniform(ranges[:, 0], ranges[:, 1], (count, len(ranges)))


def mujoco_facts(model: mujoco.MjModel, positions: np.ndarray) -> Facts:
    """Limits, kinematics and dynamics by MuJoCo, joints in canonical order."""
    names = joint_names(model)
    columns = [model.joint(name).dofadr[0] for name in names]
    data = mujoco.MjData(model)
    poses, jacobians, masses, gravity = [], [], [], []
    for q in positions:
        data.qpos[columns] = q
        mujoco.mj_forward(model, data)
        poses.append([_mujoco_pose(data.body(link)) for link in LINKS])
        for hand in HANDS:
            jacobian = np.zeros((6, model.nv))
            mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], model.body(hand).id)
            jacobians.append(jacobian[:, columns])
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        masses.append(mass[np.ix_(columns, columns)])
        gravity.append(data.qfrc_bias[columns])
    speeds = velocity_limits(model)
    return {
        "range": np.array([model.joint(name).range for name in names]),
        "effort": np.array([model.actuator(name).ctrlrange[1] for name in names]),
        "speed": np.array([speeds[name] for name in names]),
        "damping": np.array([model.joint(name).damping[0] for name in names]),
        "poses": np.array(poses),
        "jacobians": np.array(jacobians),
        "mass": np.array(masses),
        "gravity": np.array(gravity),
    }


def _mujoco_pose(body) -> np.ndarray:
    return np.column_stack([body.xmat.reshape(3, 3), body.xpos])


def pinocchio_facts(model: pin.Model, names: list[str], positions: np.ndarray) -> Facts:
    """The same facts by Pinocchio, joints in the order of `names`."""
    columns = [model.idx_vs[model.getJointId(name)] for name in names]
    data = model.createData()
    frames = {link: model.getFrameId(link, pin.FrameType.BODY) for link in LINKS}
    poses, jacobians, masses, gravity = [], [], [], []
    for q in positions:
        ordered = np.zeros(model.nq)
        ordered[columns] = q
        pin.framesForwardKinematics(model, data, ordered)
        poses.append([data.oMf[frames[link]].homogeneous[:3] for link in LINKS])
        for hand in HANDS:
            jacobian = pin.computeFrameJacobian(
                model, data, ordered, frames[hand], pin.LOCAL_WORLD_ALIGNED
            )
            jacobians.append(jacobian[:, columns])
        mass = pin.crba(model, data, ordered)
        mass = np.triu(mass) + np.triu(mass, 1).T
        masses.append(mass[np.ix_(columns, columns)])
        gravity.append(pin.computeGeneralizedGravity(model, data, ordered)[columns])
    ranges = np.column_stack([model.lowerPositionLimit, model.upperPositionLimit])
    return {
        "range": ranges[columns],
        "effort": model.effortLimit[columns],
        "speed": model.velocityLimit[columns],
        "damping": model.damping[columns],
        "poses": np.array(poses),
        "jacobians": np.array(jacobians),
        "mass": np.array(masses),
        "gravity": np.array(gravity),
    }


def deviation(left: Facts, right: Facts) -> dict[str, float]:
    """Largest absolute difference of each fact [SI]."""
    return {key: float(np.abs(left[key] - right[key]).max()) for key in left}


@pytest.mark.parametrize("name", RECIPES)
def test_the_shipped_file_is_what_the_generator_makes(name):
    assert asset_path(f"{name}.xml").read_text() == shipped_mjcf(name)


def test_every_link_is_a_body_and_the_grippers_are_gone(mj_model):
    bodies = {mj_model.body(i).name for i in range(1, mj_model.nbody)}
    assert bodies == set(LINKS)
    assert len(LINKS) == 45
    assert not [link for link in LINKS if "gripper" in link]
    official = description_path("baxter_description/urdf/baxter.urdf").read_text()
    assert len(ET.fromstring(official).findall("link")) == 45 + 12


def test_removing_an_unknown_branch_names_the_valid_joints():
    with pytest.raises(ValueError, match=r"'elbow'.*left_s0"):
        without_branches(URDF, ("elbow",))
    with pytest.raises(ValueError, match=GRIPPER_JOINTS[0]):
        without_branches(URDF, GRIPPER_JOINTS)


def test_torso_frame_is_the_base_frame_at_the_origin(mj_model):
    data = mujoco.MjData(mj_model)
    mujoco.mj_kinematics(mj_model, data)
    for link in ("base", "torso"):
        np.testing.assert_array_equal(_mujoco_pose(data.body(link)), np.eye(4)[:3])


def test_each_body_has_the_mass_and_inertia_of_its_link(mj_model):
    for link in ET.fromstring(URDF).findall("link"):
        inertial, body = link.find("inertial"), mj_model.body(link.attrib["name"])
        if inertial is None:
            assert body.mass[0] == 0.0
            continue
        official = inertial.find("inertia").attrib
        rows = [["ixx", "ixy", "ixz"], ["ixy", "iyy", "iyz"], ["ixz", "iyz", "izz"]]
        expected = np.array([[float(official[key]) for key in row] for row in rows])
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, body.iquat)
        rotation = rotation.reshape(3, 3)
        # MuJoCo diagonalises iteratively, to about 1e-13 of the largest moment.
        actual = rotation @ np.diag(body.inertia) @ rotation.T
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12 * expected.max())
        assert body.mass[0] == float(inertial.find("mass").attrib["value"])
        com = [float(x) for x in inertial.find("origin").attrib["xyz"].split()]
        np.testing.assert_array_equal(body.ipos, com)


def test_mujoco_agrees_with_pinocchio_from_the_official_urdf(mj_model, pin_model):
    positions = sampled_positions(mj_model)
    names = joint_names(mj_model)
    assert names == sorted(pin_model.names[1:])
    found = deviation(
        mujoco_facts(mj_model, positions), pinocchio_facts(pin_model, names, positions)
    )
    assert max(found.values()) < ROUNDING, found
    assert [found[key] for key in ("range", "effort", "speed", "damping")] == [0.0] * 4


def test_pinocchio_reads_the_same_robot_from_mjcf_but_for_speed_limits(
    mj_model, pin_model, pin_model_from_mjcf
):
    positions = sampled_positions(mj_model)
    names = joint_names(mj_model)
    found = deviation(
        pinocchio_facts(pin_model_from_mjcf, names, positions),
        pinocchio_facts(pin_model, names, positions),
    )
    assert found.pop("speed") == np.inf
    assert max(found.values()) < ROUNDING, found


def heavier_wrist(spec: mujoco.MjSpec) -> None:
    spec.body("left_wrist").mass *= 1.01


def swapped_joints(spec: mujoco.MjSpec) -> None:
    shoulder, elbow = spec.joint("left_s1"), spec.joint("left_e1")
    shoulder.name = "spare"
    elbow.name, shoulder.name = "left_s1", "left_e1"


def moved_hand(spec: mujoco.MjSpec) -> None:
    spec.body("right_hand_link").pos[2] += 0.001


@pytest.mark.parametrize(
    ("tamper", "fact", "at_least"),
    [
        (heavier_wrist, "gravity", 1e-2),  # 34 mN more weight at up to 1 m
        (heavier_wrist, "mass", 1e-4),
        (swapped_joints, "poses", 0.1),
        (swapped_joints, "range", 0.1),
        (moved_hand, "jacobians", 5e-4),  # 1 mm of lever
    ],
)
def test_a_tampered_robot_is_caught(
    pin_model, tamper: Callable[[mujoco.MjSpec], None], fact: str, at_least: float
):
    spec = mujoco.MjSpec.from_file(str(asset_path("baxter.xml")))
    tamper(spec)
    model = spec.compile()
    positions = sampled_positions(model)
    names = joint_names(model)
    found = deviation(mujoco_facts(model, positions), pinocchio_facts(pin_model, names, positions))
    assert found[fact] > at_least


def test_geoms_are_named_and_touch_nothing_unless_paired(mj_model):
    assert all(mj_model.geom(i).name for i in range(mj_model.ngeom))
    assert not mj_model.geom_contype.any()
    assert not mj_model.geom_conaffinity.any()
    shaped = {mj_model.body(i).name for i in mj_model.geom_bodyid}
    for side in ("left", "right"):
        assert {f"{side}_upper_elbow_visual", f"{side}_wrist", f"{side}_hand_link"} <= shaped


def test_visuals_are_complete_and_within_budget():
    visuals = load_visuals(URDF, FILE)
    described = [
        link.attrib["name"]
        for link in ET.fromstring(URDF).findall("link")
        if link.find("visual/geometry/mesh") is not None
    ]
    assert [visual.link for visual in visuals] == described
    assert len(visuals) == 18
    arrays = [(v.vertices, v.faces, v.normals, v.colors) for v in visuals]
    assert sum(array.nbytes for each in arrays for array in each) < 6e6
    for visual in visuals:
        assert visual.faces.max() < len(visual.vertices) == len(visual.colors)
        # float32 unit vectors
        np.testing.assert_allclose(np.linalg.norm(visual.normals, axis=1), 1.0, atol=1e-6)


@pytest.fixture(scope="module")
def pin_visuals(pin_model) -> dict[str, pin.GeometryObject]:
    """Pinocchio's visual meshes, read by assimp as RViz does, by link."""
    robots = description_path("baxter_description/urdf/baxter.urdf").parents[2]
    packages = str(robots.parents[1])
    shapes = pin.buildGeomFromUrdfString(
        pin_model, URDF, pin.GeometryType.VISUAL, package_dirs=[packages]
    )
    meshes = [shape for shape in shapes.geometryObjects if shape.meshPath.endswith(".DAE")]
    return {pin_model.frames[shape.parentFrame].name: shape for shape in meshes}


def largest_box_error(shapes: dict[str, pin.GeometryObject], turn: np.ndarray) -> float:
    """Largest difference [m] between the boxes around our meshes, turned, and Pinocchio's."""
    errors = []
    for visual in load_visuals(URDF, FILE):
        geometry = shapes[visual.link].geometry
        geometry.computeLocalAABB()
        vertices = visual.vertices @ turn.T
        errors.append(vertices.min(axis=0) - geometry.aabb_local.min_)
        errors.append(vertices.max(axis=0) - geometry.aabb_local.max_)
    return float(np.abs(errors).max())


def test_meshes_have_the_size_and_axes_that_pinocchio_sees(pin_visuals):
    # Decimation moves the outline by at most 1.4 mm (of the 0.9 m torso).
    assert largest_box_error(pin_visuals, np.eye(3)) < 2e-3


def test_a_mesh_turned_from_y_up_to_z_up_is_caught(pin_visuals):
    assert largest_box_error(pin_visuals, np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])) > 0.5


def test_meshes_sit_in_their_links_where_pinocchio_has_them(pin_model, pin_visuals):
    for visual in load_visuals(URDF, FILE):
        shape = pin_visuals[visual.link]
        placement = pin_model.frames[shape.parentFrame].placement.actInv(shape.placement)
        np.testing.assert_allclose(visual.X_LM, placement.homogeneous, atol=ROUNDING)


def test_both_hands_carry_a_pad_of_100_grams():
    spec = mujoco.MjSpec.from_file(str(asset_path("baxter.xml")))
    for side in ("left", "right"):
        pad = mujoco.MjSpec.from_file(str(asset_path("palm_pad.xml")))
        spec.attach(pad, prefix=f"{side}_", frame=spec.body(f"{side}_hand_link").add_frame())
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for side in ("left", "right"):
        assert model.body(f"{side}_pad").mass[0] == 0.1
        assert model.geom(f"{side}_tip").size[0] == 0.03
        hand, center = data.body(f"{side}_hand_link"), data.site(f"{side}_tip_center").xpos
        # One rotation and one addition in double precision.
        expected = hand.xpos + 0.08 * hand.xmat.reshape(3, 3)[:, 2]
        np.testing.assert_allclose(center, expected, atol=1e-15)
        np.testing.assert_allclose(data.geom(f"{side}_tip").xpos, center, atol=1e-15)
    assert len(velocity_limits(model)) == 15


def test_pad_inertia_is_that_of_its_two_solids():
    spec = mujoco.MjSpec.from_file(str(asset_path("palm_pad.xml")))
    stated = spec.compile().body("pad")
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    spec.geom("stem").mass, spec.geom("tip").mass = 0.04, 0.06
    solid = spec.compile().body("pad")
    assert stated.mass[0] == pytest.approx(solid.mass[0], rel=1e-12)  # rounding
    np.testing.assert_allclose(stated.ipos, solid.ipos, atol=1e-12)
    np.testing.assert_allclose(np.sort(stated.inertia), np.sort(solid.inertia), rtol=1e-9)


def test_a_missing_asset_or_description_is_named():
    with pytest.raises(FileNotFoundError, match=r"'atlas.xml'.*baxter.xml.*palm_pad.xml"):
        asset_path("atlas.xml")
    with pytest.raises(FileNotFoundError, match=r"'baxter/x'.*robots"):
        description_path("baxter/x")
