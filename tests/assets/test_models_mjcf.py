"""Robots of any MJCF file are taken with motors and without their surroundings, or refused."""

import re

import mujoco
import pytest

from fulcrum.assets.mjcf import LOOKS, SOLID
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.model.scene import compose, unwanted_pairs
from fulcrum.synthesis import InvalidInputError
from tests.helpers.models import BOX, FOREIGN, TETRAHEDRON, driving, foreign


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


def test_a_foreign_file_s_meshes_come_along_under_the_prefix(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "pyramid.obj").write_text(TETRAHEDRON)
    asset = '<compiler meshdir="parts"/><asset><mesh file="pyramid.obj"/></asset><worldbody>'
    text = FOREIGN.replace("<worldbody>", asset).replace(
        '<geom type="sphere" size="0.04" mass="0.5"/>',
        '<geom type="mesh" mesh="pyramid" mass="0.5"/>',
    )
    for prefix in ("", "a_"):
        model = compose(driving(foreign(tmp_path, text), "lift", prefix=prefix)).compile()
        geom = model.geom(f"{prefix}hand")
        assert geom.type == mujoco.mjtGeom.mjGEOM_MESH
        assert model.mesh_vertnum[geom.dataid[0]] == 4
