"""A recording read back is the run."""

import json
from itertools import pairwise

import numpy as np
import pytest
from rerun.chunk import RrdReader

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.run.execute import Request, execute
from fulcrum.synthesis.arrays import N
from tests.helpers.recordings import NANOSECOND, Content, verified

SCENARIO = scenario("box-tilt")
CONTACTS = SCENARIO.contact_names
# Scalars are stored in double precision; only the order of operations differs.
ROUNDING = 1e-12
# 3D quantities are stored in single precision, 6e-8 of numbers up to 1 (metres, quaternions).
SINGLE = 2e-7
POSE_STRIDE = 20  # 50 Hz of 1 kHz
METERS_PER_NEWTON = 0.003
CONE_LENGTH = 0.06
MAX_BYTES = 20e6


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("recorded")


@pytest.fixture(scope="module")
def result(folder):
    return execute(Request(SCENARIO, "margin", SCENARIO.control, out=folder))


@pytest.fixture(scope="module")
def recording(result, folder):
    return folder / "run.rrd"


@pytest.fixture(scope="module")
def content(recording):
    return Content(recording)


# --- a whole run ---


def test_the_recording_is_whole_and_small(recording):
    assert verified(recording)
    assert recording.stat().st_size <= MAX_BYTES


def test_a_truncated_recording_is_caught(recording, tmp_path):
    (tmp_path / "cut.rrd").write_bytes(recording.read_bytes()[:-1000])
    assert not verified(tmp_path / "cut.rrd")


def test_scene_and_texts_are_there(content):
    sides = ("left", "right")
    parts = ("shoulder", "elbow", "forearm")
    arms = {f"{s}_{at}_{part}" for s in sides for at in ("upper", "lower") for part in parts}
    links = arms | {f"{s}_wrist" for s in sides} | {"torso", "head", "pedestal"}
    meshes = {e.split("/")[1] for e in content.entities if e.split("/")[-1].startswith("mesh_")}
    assert links <= meshes
    shapes = {"world/box/box", "world/world/table", "world/left_pad/left_tip"}
    assert shapes | {"world/right_pad/right_tip", "config", "verdict"} <= content.entities


def test_meshes_are_real_and_placed_by_moving_links(content):
    mesh = next(e for e in content.entities if e.startswith("world/left_wrist/mesh_"))
    assert len(content.static(mesh, "Mesh3D:vertex_positions")) > 100
    _, positions = content.poses("left_wrist", "Transform3D:translation")
    # The hands sit 0.225 m from the axis about which they turn by 90 deg.
    assert np.ptp(positions, axis=0).max() > 0.1


def test_every_scalar_series_is_the_trace_at_full_rate(content, result):
    trace, history = result.trace, result.history
    robot = json.loads(content.text("config")[8:-4])["scenario"]["robots"][0]
    tilt = np.degrees(np.column_stack([trace.tilt_ref, trace.tilt]))
    expected = {
        "tilt": tilt,
        "tilt_error": tilt[:, 1:] - tilt[:, :1],
        "normal_force": np.column_stack(
            [trace.w_commanded_C[..., N], history.w_measured_C[..., N]]
        ),
        "utilisation": np.where(history.kept, history.utilisation, 0.0),
        "slip": 1e3 * history.slip,
    }
    for name, values in expected.items():
        times, recorded = content.series(f"plots/{name}", "Scalars:scalars")
        assert np.abs(times - trace.t).max() < NANOSECOND, name
        assert recorded.shape == values.shape, name
        assert np.abs(recorded - values).max() <= ROUNDING * np.abs(values).max(), name
    times, torque = content.series("plots/torque", "Scalars:scalars")
    assert torque.shape == (len(trace), len(robot["posture"]) + 2)
    # Baxter's limits are symmetric: 50 N m, and 15 N m at the wrists.
    limit = np.abs(trace.tau / torque[:, :-2])
    assert np.isclose(np.nanmedian(limit, axis=0), [50, 50, 50, 50, 15, 15, 15] * 2).all()
    assert np.ptp(limit, axis=0).max() < 1e-9
    assert (torque[:, -2:] == [-1.0, 1.0]).all()


def test_solver_times_are_recorded_at_the_syntheses(content, result):
    due = result.trace.synthesis_s > 0.0
    times, recorded = content.series("plots/synthesis", "Scalars:scalars")
    assert np.abs(times - result.trace.t[due]).max() < NANOSECOND
    assert np.allclose(recorded[:, 0], 1e6 * result.trace.synthesis_s[due], rtol=ROUNDING, atol=0)


def test_a_series_of_another_moment_is_not_the_trace(content, result):
    # The comparison above would notice a shift by a single step.
    _, recorded = content.series("plots/tilt", "Scalars:scalars")
    shifted = np.degrees(np.roll(result.trace.tilt, 1))
    assert np.abs(recorded[:, 1] - shifted)[1:].max() > 1e6 * ROUNDING * np.abs(shifted).max()


def test_poses_are_the_trace_s_at_50_hz(content, result):
    rows = result.trace.pick(np.arange(0, len(result.trace), POSE_STRIDE))
    times, positions = content.poses("box", "Transform3D:translation")
    assert np.abs(times - rows.t).max() < NANOSECOND
    assert np.abs(positions - rows.p_WO).max() < SINGLE
    _, quaternions = content.poses("box", "Transform3D:quaternion")
    assert np.abs(quaternions - np.roll(rows.quat_WO, -1, axis=1)).max() < SINGLE
    for i, hand in enumerate(("left", "right")):
        # The tip is the pad's site, 0.08 m out along the hand's z axis: the same turn.
        _, quaternions = content.poses(f"{hand}_pad", "Transform3D:quaternion")
        tip = np.roll(rows.quat_WE[:, i], -1, axis=1)
        assert np.abs(np.abs(np.sum(quaternions * tip, axis=1)) - 1.0).max() < SINGLE


@pytest.mark.parametrize("contact", CONTACTS)
def test_arrows_are_the_forces_to_scale_at_their_contacts(content, result, contact):
    i = CONTACTS.index(contact)
    steps = np.arange(0, len(result.trace), POSE_STRIDE)
    rows, R_WC = result.trace.pick(steps), result.history.R_WC[steps]
    commanded = np.einsum("kij,kj->ki", R_WC[:, i], rows.w_commanded_C[:, i, :3])
    for kind, forces in (("measured", rows.f_W[:, i, :3]), ("commanded", commanded)):
        times, vectors = content.series(f"forces/{kind}", "Arrows3D:vectors")
        assert np.abs(times - rows.t).max() < NANOSECOND
        vectors = vectors.reshape(len(rows), len(CONTACTS), 3)[:, i]
        assert np.abs(vectors - METERS_PER_NEWTON * forces).max() < SINGLE
        _, origins = content.series(f"forces/{kind}", "Arrows3D:origins")
        origins = origins.reshape(len(rows), len(CONTACTS), 3)[:, i]
        assert np.abs(origins - rows.p_WC[:, i]).max() < SINGLE
    # They are forces that hold 20 N, so some centimetres long.
    assert np.linalg.norm(METERS_PER_NEWTON * rows.f_W[:, i, :3], axis=1).max() > 0.01


@pytest.mark.parametrize("contact", CONTACTS)
def test_cones_open_by_the_true_friction_about_the_normal(content, result, contact):
    i = CONTACTS.index(contact)
    mu = (*SCENARIO.hands, *SCENARIO.supports)[i].friction.mu
    steps = np.arange(0, len(result.trace), POSE_STRIDE)
    times, points = content.series("cones", "LineStrips3D:strips")
    assert np.abs(times - result.trace.t[steps]).max() < NANOSECOND
    strip = points.reshape(len(steps), len(CONTACTS), -1, 3)[:, i]
    apex, rim = strip[:, 0], strip[:, 1:7] - strip[:, :1]
    assert np.abs(apex - result.trace.p_WC[steps, i]).max() < SINGLE
    # In contact axes (t, o, n) every ray is the friction cone's, all around; a slope is what is
    # stored over the cone's length.
    rays = np.einsum("kji,kpj->kpi", result.history.R_WC[steps, i], rim)
    slopes = np.linalg.norm(rays[..., :2], axis=2) / rays[..., 2]
    assert np.abs(slopes - mu).max() < SINGLE / CONE_LENGTH
    assert np.abs(rays[..., 2] - CONE_LENGTH).max() < SINGLE
    assert np.abs(rays[..., :2].mean(axis=1)).max() < SINGLE
    # What follows are the same points again: every ray is drawn, and the rim closed.
    drawn = {frozenset(pair) for pair in pairwise([0, 1, 2, 3, 4, 5, 6, 1, 2, 0, 3, 4, 0, 5, 6, 0])}
    assert strip.shape[1] == 16
    assert np.array_equal(strip[:, 7:], strip[:, [1, 2, 0, 3, 4, 0, 5, 6, 0]])
    rays_and_rim = {frozenset((0, k)) for k in range(1, 7)}
    rays_and_rim |= {frozenset((k, k % 6 + 1)) for k in range(1, 7)}
    assert drawn == rays_and_rim


def test_arrows_and_cones_are_named_after_their_contacts(content):
    for entity, kind in (
        ("forces/measured", "Arrows3D"),
        ("forces/commanded", "Arrows3D"),
        ("cones", "LineStrips3D"),
    ):
        assert tuple(content.static(entity, f"{kind}:labels")) == CONTACTS


def test_the_texts_are_verdict_and_configuration(content, result, folder):
    assert result.report.verdict is Verdict.PASS
    verdict = content.text("verdict")
    assert verdict.startswith("# box-tilt: PASS\n")
    assert "FAIL" not in verdict
    config = content.text("config")
    assert config.startswith("```json\n")
    assert json.loads(config[8:-4]) == json.loads((folder / "config.json").read_text())


def test_the_blueprint_shows_the_scene_every_curve_and_the_texts(content, recording):
    reader = RrdReader(recording)
    (blueprint,) = reader.blueprints()
    views = set()
    for chunk in reader.stream(store=blueprint).to_chunks():
        batch = chunk.to_record_batch()
        if "ViewBlueprint:class_identifier" in batch.schema.names:
            kind = batch["ViewBlueprint:class_identifier"].to_pylist()[0][0]
            views.add((kind, batch["ViewBlueprint:space_origin"].to_pylist()[0][0].strip("/")))
    curves = {("TimeSeries", e) for e in content.entities if e.startswith("plots/")}
    assert len(curves) == 8
    texts = {("TextDocument", "verdict"), ("TextDocument", "config")}
    assert views == curves | texts | {("3D", ""), ("StateTimeline", "phase")}


def test_the_phases_are_marked_in_order_when_they_begin(content, result):
    changes, phases = content.states("phase"), SCENARIO.phases
    assert [name for _, name in changes] == [phase.name for phase in phases]
    starts = Schedule(SCENARIO).starts
    # A phase begins with the first step in it, at most one step late, and at the report's times.
    late = np.array([t for t, _ in changes]) - starts
    assert late.min() > -2 * NANOSECOND
    assert late.max() < 0.001 + 2 * NANOSECOND
    trace = result.trace
    begun = [trace.t[np.argmax(trace.phase == i)] for i in range(len(phases))]
    assert np.abs(np.array([t for t, _ in changes]) - begun).max() < NANOSECOND
    assert [phase.name for phase in result.report.phases] == [name for _, name in changes]
