"""Robots of any URDF or MJCF file are taken as they are described, or refused in one sentence."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from assets import description_path
from assets.mjcf import LOOKS, SOLID
from assets.models import robot_spec
from assets.packages import ModelError
from scenarios import scenario
from sim.robot import RobotModel, pinocchio_model
from sim.scene import compose, unwanted_pairs
from synthesis import InvalidInputError

BOX = scenario("box-tilt")
URDFS = {
    "so100": description_path("so_arm_description/urdf/so100.urdf"),
    "kinova": description_path("kinova_description/robots/kinova.urdf"),
    "panda": description_path("panda_description/urdf/panda.urdf"),
    "ur5": description_path("ur_description/urdf/ur5_robot.urdf"),
}
# Both libraries compute in double precision, over chains of ten frames at 1 m and 100 N m.
ROUNDING = 1e-11


def scene_with(model, **changes):
    """The box's scene with another robot, held by nobody."""
    robot = replace(BOX.robots[0], model=str(model), posture={}, **changes)
    return replace(BOX, robots=(robot,), hands=())


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


# --- URDF ---


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
    official = pin.buildModelFromUrdf(str(URDFS[name]))
    model = robot_spec(name)
    if name == "panda":  # ships without its hand
        lighter = deviation(ours(model), official)
        assert lighter.max() > 0.1
        joints = ("panda_joint8", "panda_hand_joint")
        hand = official.inertias[official.getJointId("panda_joint7")]
        assert hand.mass > model.body("panda_link7").mass
        assert joints[0] not in [joint.name for joint in model.joints]
    else:
        assert deviation(ours(model), official).max() < ROUNDING


TWO_LINKS = """
<robot name="two links">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="foot">{foot}</link>
  <link name="arm">
    <inertial>
      <origin xyz="0 0 0.2"/><mass value="1"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <geometry><cylinder radius="0.02" length="0.4"/></geometry><material name="blue"/>
    </visual>
  </link>
  <joint name="elbow" type="{kind}">
    <parent link="foot"/><child link="arm"/><axis xyz="0 1 0"/>{limit}
  </joint>
</robot>
"""
LIMIT = '<limit lower="-1" upper="1" effort="20" velocity="2"/>'


def written(folder, text=TWO_LINKS, foot="", kind="revolute", limit=LIMIT):
    file = folder / "robot.urdf"
    file.write_text(text.format(foot=foot, kind=kind, limit=limit))
    return file


def with_elbow(file, **changes):
    """The box's scene with the robot of two links, its elbow driven."""
    scene = scene_with(file, **changes)
    return replace(scene, robots=(replace(scene.robots[0], posture={"elbow": 0.1}),))


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
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


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


# --- MJCF ---

FOREIGN = """
<mujoco>
  <option integrator="RK4" density="1000"><flag gravity="disable"/></option>
  <default>
    <geom density="50" margin="0.1" group="1"/>
    <joint damping="0.3" armature="0.2"/>
    <general forcerange="-1 1"/>
  </default>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="foot" pos="0 0 0.1">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body gravcomp="1">
        <joint name="lift" type="slide" axis="0 0 1" range="0 0.5" user="0.4"
               actuatorfrcrange="-40 40"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 0.4" mass="2"/>
        <geom type="box" size="0.05 0.05 0.05" contype="0" conaffinity="0"/>
        <body name="hand" pos="0 0 0.4">
          <joint name="turn" axis="0 1 0" user="3"/>
          <joint name="twist" axis="0 0 1" user="3"/>
          <geom type="sphere" size="0.04" mass="0.5"/>
          <site name="palm"/>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="both"><joint joint="turn" coef="1"/><joint joint="twist" coef="1"/></fixed>
  </tendon>
  <equality><joint joint1="turn" joint2="twist"/></equality>
  <actuator>
    <position name="p" joint="turn" kp="100" forcerange="-7 7"/>
    <motor name="m" joint="lift" gear="2" ctrlrange="-30 15" forcerange="-20 50"/>
    <position name="t" tendon="both" forcerange="-3 3"/>
  </actuator>
  <sensor><jointpos joint="turn"/><actuatorfrc actuator="p"/></sensor>
  <keyframe><key qpos="0.1 0 0"/></keyframe>
</mujoco>
"""


def foreign(folder, text=FOREIGN):
    file = folder / "foreign.xml"
    file.write_text(text)
    return file


def driving(file, *joints, **changes):
    scene = scene_with(file, **changes)
    return replace(scene, robots=(replace(scene.robots[0], posture=dict.fromkeys(joints, 0.0)),))


@pytest.mark.parametrize("prefix", ["", "a_"])
def test_position_drives_become_motors_with_the_narrowest_limits_that_are_stated(tmp_path, prefix):
    scene = driving(foreign(tmp_path), "lift", "turn", prefix=prefix)
    model = compose(scene).compile()
    drives = {model.joint(int(j)).name: i for i, j in enumerate(model.actuator_trnid[:, 0])}
    limits = {name: model.actuator(i).ctrlrange.tolist() for name, i in drives.items()}
    # With gear 2 the control's range is -60 to 30 and the force's -40 to 100; the joint says 40.
    assert limits == {f"{prefix}lift": [-40.0, 30.0], f"{prefix}turn": [-7.0, 7.0]}
    # One unit of control is one of torque or force, whatever the robot was driven by before.
    data = mujoco.MjData(model)
    mujoco.mj_resetData(model, data)
    data.ctrl[:] = 5.0
    mujoco.mj_forward(model, data)
    for name in drives:
        assert data.qfrc_actuator[model.joint(name).dofadr[0]] == 5.0


def test_a_joint_that_only_a_tendon_drives_needs_a_limit_from_the_scenario(tmp_path):
    file = foreign(tmp_path)
    with pytest.raises(InvalidInputError, match=r"^robot\.torque_limits\.twist: got none"):
        compose(driving(file, "twist"))
    belief = RobotModel(driving(file, "twist", torque_limits={"twist": 2.0}))
    assert belief.tau_max.tolist() == [2.0]


@pytest.mark.parametrize("prefix", ["", "a_"])
def test_a_foreign_file_brings_nothing_but_its_robot(tmp_path, prefix):
    """Neither its floor, lights, drives, options nor main defaults; with a prefix or without."""
    model = compose(driving(foreign(tmp_path), "lift", "turn", prefix=prefix)).compile()
    plain = compose(BOX).compile()
    assert (model.nsensor, model.neq, model.ntendon, model.nkey) == (0, 0, 0, 0)
    assert model.nlight == plain.nlight
    names = [model.geom(g).name for g in range(model.ngeom)]
    assert "floor" not in names
    assert all(names)
    assert not model.geom_contype.any()
    assert (model.opt.integrator, model.opt.density) == (plain.opt.integrator, 0.0)
    assert model.opt.disableflags == plain.opt.disableflags
    assert not model.body_gravcomp.any()
    for field in ("damping", "armature"):
        assert not getattr(model, f"dof_{field}")[model.joint("box").dofadr[0] :][:6].any()
    for name in ("box", "table"):
        assert model.geom(name).group == plain.geom(name).group
        assert model.geom(name).margin == 0.0
    assert not model.pair_margin.any()
    assert model.body("box").mass == plain.body("box").mass
    # What is the robot's own stays.
    assert (model.dof_armature[model.joint(f"{prefix}turn").dofadr[0]]) == 0.2
    assert model.body(f"{prefix}hand").mass[0] == 0.5


def test_shapes_that_are_only_looked_at_may_pass_through_others(tmp_path):
    scene = driving(foreign(tmp_path), "lift", "turn")
    model = compose(scene).compile()
    groups = [int(model.geom_group[g]) for g in range(model.ngeom)]
    (looks,) = [g for g, group in enumerate(groups) if group == LOOKS]
    assert model.geom_type[looks] == mujoco.mjtGeom.mjGEOM_BOX
    links = {first for first, _ in unwanted_pairs(scene, model)}
    assert model.geom(looks).name not in links
    assert links == {g.name for g in map(model.geom, range(model.ngeom)) if g.group[0] == SOLID} - {
        "foot"
    }


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ('name="twist" axis="0 0 1"', 'name="twist" type="ball"', "joint twist of type ball"),
        ('name="turn" axis="0 1 0"', 'name="turn" axis="0 1 0" ref="0.1"', "joint turn with a ref"),
        ('mass="0.5"', 'mass="0"', "hand"),
    ],
)
def test_a_foreign_file_that_cannot_be_taken_is_refused_by_the_name_of_its_part(
    tmp_path, right, wrong, told
):
    text = FOREIGN.replace('<equality><joint joint1="turn" joint2="twist"/></equality>', "")
    text = re.sub("<tendon>.*</tendon>", "", text, flags=re.DOTALL).replace(
        '<position name="t" tendon="both" forcerange="-3 3"/>', ""
    )
    compose(driving(foreign(tmp_path, text), "lift"))
    assert right in text
    with pytest.raises(InvalidInputError, match=r"^robot\.model: got ") as error:
        compose(driving(foreign(tmp_path, text.replace(right, wrong)), "lift"))
    assert told in str(error.value)
