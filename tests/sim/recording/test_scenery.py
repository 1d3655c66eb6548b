"""A recording shows every robot: its meshes, or the shapes that stand for it."""

import re

import rerun as rr

from fulcrum.scenarios import scenario
from fulcrum.sim.model.robot_model import RobotModel
from fulcrum.sim.recording.scenery import Scenery
from tests.helpers.models import driving, foreign, with_elbow, written
from tests.helpers.recordings import Content


def shown(tmp_path, scene):
    """Entities of the shapes that a recording of a scene shows."""
    path = tmp_path / "shapes.rrd"
    recording = rr.RecordingStream("shapes")
    recording.save(path)
    Scenery(scene, tuple(RobotModel(scene).joints)).log_shapes(recording)
    recording.flush()
    recording.disconnect()
    return Content(path).entities


def test_a_recording_shows_the_meshes_of_every_robot_under_its_prefix(tmp_path):
    found = shown(tmp_path, scenario("panda-box"))
    for side in ("left", "right"):
        meshes = [e for e in found if re.fullmatch(rf"world/{side}_panda_link\d/mesh_\d+", e)]
        assert len(meshes) == 8
        # Boxes that stand for links where nothing else does are not shown beside their meshes.
        assert f"world/{side}_panda_link3/{side}_panda_link3" not in found
        assert f"world/{side}_pad/{side}_tip" in found


def test_a_recording_shows_the_shapes_of_a_robot_without_meshes(tmp_path):
    found = shown(tmp_path, with_elbow(written(tmp_path)))
    assert "world/arm/arm" in found
    assert not [e for e in found if "mesh" in e]
    found = shown(tmp_path, driving(foreign(tmp_path), "lift", "turn"))
    # Of a robot with geoms to be looked at, those.
    assert "world/foot_part/foot_part_1" in found
    assert "world/foot_part/foot_part" not in found
