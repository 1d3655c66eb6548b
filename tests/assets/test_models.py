"""Robots of any URDF file are taken as they are described, or refused in one sentence."""

import re

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from fulcrum.assets import description_path
from fulcrum.assets.from_urdf import urdf_of
from fulcrum.assets.models import robot_spec
from fulcrum.assets.packages import ModelError
from fulcrum.sim.model.robot_model import RobotModel, pinocchio_model
from fulcrum.sim.model.scene import compose
from fulcrum.synthesis import InvalidInputError
from tests.helpers.models import TETRAHEDRON, TWO_LINKS, scene_with, with_elbow, written

URDFS = {
    "so100": description_path("so_arm_description/urdf/so100.urdf"),
    "kinova": description_path("kinova_description/robots/kinova.urdf"),
    "panda": description_path("panda_description/urdf/panda.urdf"),
    "ur5": description_path("ur_description/urdf/ur5_robot.urdf"),
}
# Both libraries compute in double precision, over chains of ten frames at 1 m and 100 N m.
ROUNDING = 1e-11


def deviation(found, expected, samples=5):
    """Largest differences of gravity [N m] and mass matrix [kg m^2] of two Pinocchio models.

    Joints that only one of them has stay at 0.
    """
    rng = np.random.default_rng(2)
    names = [name for name in found.names[1:] if name in expected.names]
    worst = np.zeros(2)
    for _ in range(samples):
        angles = rng.uniform(-1.5, 1.5, len(names))
        facts = []
        for model in (found, expected):
            columns = [model.joints[model.getJointId(name)].idx_v for name in names]
            q = pin.neutral(model)
            for name, angle in zip(names, angles, strict=True):
                joint = model.joints[model.getJointId(name)]
                # Pinocchio has sine and cosine of a continuous joint.
                turned = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
                q[joint.idx_q : joint.idx_q + joint.nq] = turned
            data = model.createData()
            gravity = pin.computeGeneralizedGravity(model, data, q)[columns]
            mass = np.triu(pin.crba(model, data, q))
            mass = mass + np.triu(mass, 1).T
            facts.append((gravity, mass[np.ix_(columns, columns)]))
        worst = np.maximum(
            worst, [np.abs(a - b).max() for a, b in zip(facts[0], facts[1], strict=True)]
        )
    return worst


def ours(spec):
    spec.option.gravity = [0.0, 0.0, -9.81]
    return pinocchio_model(spec.compile())


@pytest.mark.parametrize("name", URDFS)
def test_pinocchio_agrees_on_gravity_and_mass_of_any_urdf(name):
    official = pin.buildModelFromUrdf(str(URDFS[name]))
    spec = robot_spec(str(URDFS[name]))
    assert deviation(ours(spec), official).max() < ROUNDING
    # A hundredth more of one link's mass is caught.
    moving = next(body for body in reversed(spec.bodies) if body.joints)
    moving.mass *= 1.01
    assert deviation(ours(spec), official).max() > 1e-5


@pytest.mark.parametrize("name", URDFS)
def test_limits_and_damping_are_those_of_the_urdf(name):
    official = pin.buildModelFromUrdf(str(URDFS[name]))
    model = robot_spec(str(URDFS[name])).compile()
    for i in range(model.nu):
        joint = model.joint(int(model.actuator_trnid[i, 0]))
        column = official.joints[official.getJointId(joint.name)].idx_v
        assert model.actuator(i).ctrlrange.tolist() == [
            -official.effortLimit[column],
            official.effortLimit[column],
        ]
        assert model.jnt_user[joint.id, 0] == official.velocityLimit[column]
        assert joint.damping[0] == official.damping[column]


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_a_shipped_arm_is_its_official_urdf(name):
    official = pin.buildModelFromXML(urdf_of(name))
    assert deviation(ours(robot_spec(name)), official).max() < ROUNDING
    # A Panda with its hand is another robot.
    whole = pin.buildModelFromUrdf(str(URDFS[name]))
    assert (deviation(ours(robot_spec(name)), whole).max() > 0.1) == (name == "panda")


def test_a_urdf_s_primitives_have_the_colour_of_a_material_by_its_name(tmp_path):
    model = robot_spec(str(written(tmp_path))).compile()
    np.testing.assert_array_equal(model.geom("arm").rgba, [0.0, 0.0, 1.0, 1.0])
    assert model.geom("arm").type == mujoco.mjtGeom.mjGEOM_CYLINDER


@pytest.mark.parametrize("kind", ["planar", "floating", "ball"])
def test_a_joint_that_the_robot_model_does_not_know_is_refused(tmp_path, kind):
    compose(with_elbow(written(tmp_path)))
    message = rf"^robot\.model: got joint elbow of type {kind}; valid is one of type revolute, "
    with pytest.raises(InvalidInputError, match=message):
        compose(with_elbow(written(tmp_path, kind=kind)))


@pytest.mark.parametrize(
    ("stated", "field", "supplied"),
    [
        ("", "torque_limits", {"torque_limits": {"elbow": 5.0}, "speed_limits": {"elbow": 1.0}}),
        ('<limit effort="0" velocity="2"/>', "torque_limits", {"torque_limits": {"elbow": 5.0}}),
        ('<limit effort="5" velocity="0"/>', "speed_limits", {"speed_limits": {"elbow": 1.0}}),
    ],
)
def test_a_driven_joint_without_a_limit_is_refused_until_the_scenario_supplies_it(
    tmp_path, stated, field, supplied
):
    file = written(tmp_path, kind="continuous", limit=stated)
    with pytest.raises(InvalidInputError, match=rf"^robot\.{field}\.elbow: got none, .*> 0 \["):
        compose(with_elbow(file))
    belief = RobotModel(with_elbow(file, **supplied))
    assert belief.tau_max.tolist() == [5.0]
    assert belief.qd_max.tolist() == [supplied.get("speed_limits", {"elbow": 2.0})["elbow"]]
    # A joint that is locked needs none.
    compose(scene_with(file))


def test_a_joint_without_a_range_has_none(tmp_path):
    limit = '<limit effort="5" velocity="2"/>'
    belief = RobotModel(with_elbow(written(tmp_path, kind="continuous", limit=limit)))
    assert (belief.q_min[0], belief.q_max[0]) == (-np.inf, np.inf)
    belief = RobotModel(with_elbow(written(tmp_path)))
    assert (belief.q_min[0], belief.q_max[0]) == (-1.0, 1.0)


MESH = '<visual><geometry><mesh filename="{0}"/></geometry></visual>'


@pytest.fixture
def package(tmp_path):
    """A package of a robot, with a mesh in it and another beside it."""
    folder = tmp_path / "arm_description"
    (folder / "urdf").mkdir(parents=True)
    (folder / "meshes").mkdir()
    (folder / "meshes" / "foot.obj").write_text(TETRAHEDRON)
    (tmp_path / "secret.obj").write_text(TETRAHEDRON)
    (folder / "link.obj").symlink_to(tmp_path / "secret.obj")
    (folder / "empty.obj").write_text("")
    return folder


@pytest.mark.parametrize(
    "uri", ["package://arm_description/meshes/foot.obj", "../meshes/foot.obj", "file://{0}"]
)
def test_meshes_are_found_in_the_package_of_the_urdf(package, uri):
    uri = uri.format(package / "meshes" / "foot.obj")
    spec = robot_spec(str(written(package / "urdf", foot=MESH.format(uri))))
    np.testing.assert_allclose(spec.geom("foot").size, [0.5, 0.5, 0.5])


@pytest.mark.parametrize(
    ("uri", "told"),
    [
        ("../../secret.obj", "a file below arm_description"),
        ("package://arm_description/../secret.obj", "a file below arm_description"),
        ("package://other/foot.obj", "in the package arm_description"),
        ("../link.obj", "a file below arm_description"),
        ("../meshes/hand.obj", "which is missing"),
        ("../empty.obj", "empty.obj"),
    ],
)
def test_meshes_outside_the_package_missing_or_empty_are_refused(package, uri, told):
    file = written(package / "urdf", foot=MESH.format(uri))
    with pytest.raises(ModelError, match=re.escape(told)) as error:
        robot_spec(str(file))
    assert "\n" not in str(error.value)


def test_a_changed_mesh_is_not_taken_from_the_cache(package):
    file = written(package / "urdf", foot=MESH.format("../meshes/foot.obj"))
    assert robot_spec(str(file)).geom("foot").size[0] == 0.5
    (package / "meshes" / "foot.obj").write_text(TETRAHEDRON.replace("v 1 0 0", "v 2 0 0"))
    assert robot_spec(str(file)).geom("foot").size[0] == 1.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("no XML", "a URDF or MJCF file"),
        ("<sdf/>", "root element sdf"),
        ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>', "xacro"),
        (TWO_LINKS.replace('<mass value="1"/>', '<mass value="0"/>'), "mass"),
        (TWO_LINKS.replace('value="1"', 'value="1 kg"'), "a URDF"),
        (TWO_LINKS.replace('rgba="0 0 1 1"', 'rgba="blue"'), "a URDF"),
        (TWO_LINKS.replace('<link name="arm">', "<link>"), "a URDF"),
        ("<mujoco><bodi/></mujoco>", "a file that MuJoCo reads"),
        ('<mujoco><include file="/etc/hostname"/></mujoco>', "a file below"),
        ('<mujoco><asset><mesh file="../x.stl"/></asset></mujoco>', "a file below"),
        (
            '<mujoco><compiler meshdir=".."/><asset><mesh file="x.stl"/></asset></mujoco>',
            "a file below",
        ),
    ],
)
def test_a_file_that_is_no_robot_is_refused_in_one_sentence(tmp_path, text, told):
    with pytest.raises(InvalidInputError, match=r"^robot\.model: got ") as error:
        compose(with_elbow(written(tmp_path, text=text)))
    assert told in str(error.value)
    assert "\n" not in str(error.value)
