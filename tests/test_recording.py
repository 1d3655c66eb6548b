"""A recording read back is the run; what was killed or interrupted stays readable."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from scenarios import scenario
from sim.recording.viewer import screenshot
from sim.report import Verdict
from sim.run import Request, execute
from synthesis import InvalidInputError
from synthesis.contact import N

ROOT = Path(__file__).parent.parent
SCENARIO = scenario("box-tilt")
CONTACTS = SCENARIO.contact_names
# Times are stored in whole nanoseconds, cut off.
NANOSECOND = 1.001e-9
# Scalars are stored in double precision; only the order of operations differs.
ROUNDING = 1e-12
# 3D quantities are stored in single precision, 6e-8 of numbers up to 1 (metres, quaternions).
SINGLE = 2e-7
POSE_STRIDE = 20  # 50 Hz of 1 kHz
METERS_PER_NEWTON = 0.003
MAX_BYTES = 20e6


class Content:
    """What a recording holds, by entity and component, in the order of time."""

    def __init__(self, path):
        with warnings.catch_warnings():
            # A recording that was cut off has no footer; that is the point of some tests.
            warnings.simplefilter("ignore")
            chunks = RrdReader(path).stream().to_chunks()
        self._batches = defaultdict(list)
        for chunk in chunks:
            self._batches[str(chunk.entity_path).strip("/")].append(chunk.to_record_batch())
        self.entities = set(self._batches)

    def series(self, entity, component):
        """Times [s], (k,), and values, (k, numbers per row), sorted by time."""
        times, values = [], []
        for batch in self._batches[entity]:
            if "time" in batch.schema.names and component in batch.schema.names:
                column = batch[component]
                while hasattr(column, "flatten") and "list" in str(column.type):
                    column = column.flatten()
                times.append(batch["time"].cast("int64").to_numpy() * 1e-9)
                values.append(column.to_numpy().reshape(batch.num_rows, -1))
        times, values = np.concatenate(times), np.concatenate(values)
        order = np.argsort(times, kind="stable")
        return times[order], values[order]

    def static(self, entity, component):
        """The last value of something that has no time."""
        batches = [b for b in self._batches[entity] if component in b.schema.names]
        batches = [b for b in batches if "time" not in b.schema.names]
        # Row ids rise with the time of writing.
        last = max(batches, key=lambda b: b["rerun.controls.RowId"][-1].as_py())
        return last[component].to_pylist()[-1]

    def text(self, entity):
        (text,) = self.static(entity, "TextDocument:text")
        return text

    def end(self, entity="plots/tilt", component="Scalars:scalars"):
        return self.series(entity, component)[0][-1]


def verified(path):
    """Whether `rerun rrd verify` finds the file whole."""
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


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
    _, positions = content.series("world/left_wrist", "Transform3D:translation")
    # The hands sit 0.225 m from the axis about which they turn by 90 deg.
    assert np.ptp(positions, axis=0).max() > 0.1


def test_every_scalar_series_is_the_trace_at_full_rate(content, result):
    trace, history = result.trace, result.history
    robot = json.loads(content.text("config")[8:-4])["scenario"]["robot"]
    tilt = np.degrees(np.column_stack([trace.tilt_ref, trace.tilt]))
    expected = {
        "tilt": tilt,
        "tilt_error": tilt[:, 1:] - tilt[:, :1],
        "normal_force": np.column_stack([trace.w_command_C[..., N], history.w_OC_C[..., N]]),
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
    times, positions = content.series("world/box", "Transform3D:translation")
    assert np.abs(times - rows.t).max() < NANOSECOND
    assert np.abs(positions - rows.p_WO).max() < SINGLE
    _, quaternions = content.series("world/box", "Transform3D:quaternion")
    assert np.abs(quaternions - np.roll(rows.quat_WO, -1, axis=1)).max() < SINGLE
    for i, hand in enumerate(("left", "right")):
        # The tip is the pad's site, 0.08 m out along the hand's z axis: the same turn.
        _, quaternions = content.series(f"world/{hand}_pad", "Transform3D:quaternion")
        tip = np.roll(rows.quat_WE[:, i], -1, axis=1)
        assert np.abs(np.abs(np.sum(quaternions * tip, axis=1)) - 1.0).max() < SINGLE


@pytest.mark.parametrize("contact", CONTACTS)
def test_arrows_are_the_forces_to_scale_at_their_contacts(content, result, contact):
    i = CONTACTS.index(contact)
    steps = np.arange(0, len(result.trace), POSE_STRIDE)
    rows, R_WC = result.trace.pick(steps), result.history.R_WC[steps]
    commanded = np.einsum("kij,kj->ki", R_WC[:, i], rows.w_command_C[:, i, :3])
    for kind, forces in (("measured", rows.f_W[:, i, :3]), ("commanded", commanded)):
        times, vectors = content.series(f"forces/{kind}/{contact}", "Arrows3D:vectors")
        assert np.abs(times - rows.t).max() < NANOSECOND
        assert np.abs(vectors - METERS_PER_NEWTON * forces).max() < SINGLE
        _, origins = content.series(f"forces/{kind}/{contact}", "Arrows3D:origins")
        assert np.abs(origins - rows.p_WC[:, i]).max() < SINGLE
    # They are forces that hold 20 N, so some centimetres long.
    assert np.linalg.norm(METERS_PER_NEWTON * rows.f_W[:, i, :3], axis=1).max() > 0.01


@pytest.mark.parametrize("contact", CONTACTS)
def test_cones_open_by_the_true_friction_about_the_normal(content, result, contact):
    i = CONTACTS.index(contact)
    mu = (*SCENARIO.hands, *SCENARIO.supports)[i].friction.mu
    rim = np.array(content.static(f"cones/{contact}", "LineStrips3D:strips")[-1])
    slopes = np.linalg.norm(rim[:, :2], axis=1) / rim[:, 2]
    assert np.abs(slopes - mu).max() < SINGLE
    steps = np.arange(0, len(result.trace), POSE_STRIDE)
    _, matrices = content.series(f"cones/{contact}", "Transform3D:mat3x3")
    # Column-major: the last three numbers are the cone's axis.
    assert np.abs(matrices[:, 6:] - result.history.R_WC[steps, i, :, 2]).max() < SINGLE
    _, apexes = content.series(f"cones/{contact}", "Transform3D:translation")
    assert np.abs(apexes - result.trace.p_WC[steps, i]).max() < SINGLE


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
    assert len(curves) == 7
    texts = {("TextDocument", "verdict"), ("TextDocument", "config")}
    assert views == curves | texts | {("3D", "")}


# --- killed and interrupted runs ---

# What a kill may lose [s of the run], and the block that may be under way at the last report.
MAY_BE_LOST, BLOCK = 0.5, 0.1
# Tells on its standard output how many steps are made and handed to the recorder.
TELLING_RUN = """
import sys
from pathlib import Path
from scenarios import scenario
from sim.run import Request, execute
box = scenario("box-tilt")
request = Request(box, "margin", box.control, out=Path(sys.argv[1]))
execute(request, lambda done, total: print(done, flush=True))
"""


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Folder of a run that was killed after 1.5 s, and how far it had told to be [s]."""
    folder = tmp_path_factory.mktemp("killed")
    command = [sys.executable, "-c", TELLING_RUN, str(folder)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        told = next(line for line in process.stdout if int(line) >= 1500)
        process.kill()
        # What it said between the line that was read and its death.
        told = [told, *process.stdout.read().split()][-1]
    assert process.returncode == -signal.SIGKILL
    return folder, 1e-3 * int(told)


def gaps(content, reached):
    """What a killed run that had got to a time [s] lost of it, beyond what it may lose."""
    rates = {(f"plots/{name}", "Scalars:scalars"): 1000 for name in ("tilt", "slip", "torque")}
    rates["world/box", "Transform3D:translation"] = 50
    rates[f"forces/measured/{CONTACTS[-1]}", "Arrows3D:vectors"] = 50
    lost = set()
    for (entity, component), rate in rates.items():
        times, _ = content.series(entity, component)
        even = np.abs(np.diff(times) - 1.0 / rate).max() < 2 * NANOSECOND
        if not (even and times[0] == 0.0 and times[-1] >= reached - MAY_BE_LOST):
            lost.add(entity)
    return lost


def test_a_killed_run_leaves_all_but_the_last_half_second(killed):
    folder, reached = killed
    assert reached < SCENARIO.timing.total_s - 1.0
    content = Content(folder / "run.rrd")
    assert gaps(content, reached) == set()
    # What it told is indeed how far it was.
    assert content.end() <= reached + BLOCK
    assert {"config", "verdict", "world/world/table"} <= content.entities
    assert content.text("verdict") == "The run has not ended."


def test_a_recording_that_lost_more_than_half_a_second_is_caught(killed):
    folder, reached = killed
    content = Content(folder / "run.rrd")
    assert len(gaps(content, reached + MAY_BE_LOST + 2 * BLOCK)) == 5


def test_a_killed_run_leaves_no_report(killed):
    folder, _ = killed
    assert {path.name for path in folder.iterdir()} == {"run.rrd", "config.json"}
    assert not verified(folder / "run.rrd")


def recorded_s(path):
    """How far a recording that is being written has got [s]."""
    try:
        return Content(path).end()
    except (OSError, ValueError, RuntimeError):  # nothing or no series in it yet
        return 0.0


def interrupted_run(folder, ready):
    """Exit code and output of a `fulcrum run` that gets Ctrl-C as soon as ready() holds."""
    command = [sys.executable, "-m", "scenarios.cli", "run", "box-tilt", "--out", str(folder)]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        while not ready():
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    return process.returncode, output, errors


@pytest.mark.parametrize("moment", ["while the recording is set up", "in the middle"])
def test_ctrl_c_leaves_a_whole_recording_and_a_report_that_says_interrupted(tmp_path, moment):
    recording, config = tmp_path / "run.rrd", tmp_path / "config.json"
    ready = {
        "while the recording is set up": config.exists,
        "in the middle": lambda: recorded_s(recording) > 1.0,
    }[moment]
    code, output, errors = interrupted_run(tmp_path, ready)
    assert code == 130
    assert "INTERRUPTED" in output
    assert errors == ""
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["verdict"] == "interrupted"
    (sentence,) = report["failures"]
    assert sentence.startswith("The run was interrupted at ")
    assert verified(recording)
    content = Content(recording)
    # The report counts steps, the last of which begins 1 ms before the end.
    assert content.end() == pytest.approx(report["timing"]["sim_s"] - 0.001, abs=2 * NANOSECOND)
    assert (report["timing"]["sim_s"] > 1.0) == (moment == "in the middle")
    assert report["timing"]["sim_s"] < SCENARIO.timing.total_s
    verdict = content.text("verdict")
    assert verdict.startswith("# box-tilt: INTERRUPTED\n")


# --- pictures ---


def vulkan_devices():
    """How many devices Vulkan offers here, asked of its loader: no Rerun is involved."""
    pointer, number = ctypes.c_void_p, ctypes.c_uint32

    class InstanceInfo(ctypes.Structure):
        _fields_ = (
            ("type", number),
            ("next", pointer),
            ("flags", number),
            ("application", pointer),
            ("layer_count", number),
            ("layers", pointer),
            ("extension_count", number),
            ("extensions", pointer),
        )

    try:
        vulkan = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return 0
    instance, count = pointer(), number()
    info = InstanceInfo(type=1)  # VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)) != 0:
        return 0
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    vulkan.vkDestroyInstance(instance, None)
    return count.value


needs_vulkan = pytest.mark.skipif(
    vulkan_devices() == 0, reason="no Vulkan driver (Debian: mesa-vulkan-drivers libvulkan1)"
)


@needs_vulkan
def test_pictures_of_two_moments_show_different_things(recording, tmp_path):
    pictures = []
    for at_s in (0.5, 7.0):
        path = tmp_path / f"{at_s}.png"
        screenshot(recording, at_s, path)
        with Image.open(path) as image:
            assert image.format == "PNG"
            assert image.size == (1920, 1080)
            pictures.append(np.asarray(image.convert("RGB"), np.int32))
    for picture in pictures:
        # A blank window has one colour, or a few of its frame.
        assert len(np.unique(picture @ [1 << 16, 1 << 8, 1])) > 1000
    # The box and two arms have moved: more than 1 % of the window, by more than shading noise.
    moved = np.abs(pictures[0] - pictures[1]).max(axis=2) > 30
    assert moved.mean() > 0.01
    assert moved[:, :960].any(), "nothing moved in the 3D view"


@needs_vulkan
def test_a_moment_outside_the_recording_is_refused(recording, tmp_path):
    with pytest.raises(InvalidInputError, match=r"--at: got 99 s; valid is 0 to 9\.499 s"):
        screenshot(recording, 99.0, tmp_path / "x.png")
    assert list(tmp_path.iterdir()) == []


def test_a_machine_without_vulkan_is_told_what_to_install(recording, tmp_path):
    nothing = {"VK_DRIVER_FILES": os.devnull, "VK_ICD_FILENAMES": os.devnull}
    out = tmp_path / "x.png"
    arguments = ["screenshot", str(recording), "--at", "1", "--out", str(out)]
    done = subprocess.run(
        [sys.executable, "-m", "scenarios.cli", *arguments],
        check=False,
        cwd=ROOT,
        env={**os.environ, **nothing},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "mesa-vulkan-drivers" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not out.exists()
