"""Pictures of recordings, drawn without a screen."""

import ctypes
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fulcrum.scenarios import scenario
from fulcrum.sim.recording.viewer import screenshot
from fulcrum.sim.run.execute import Request, execute
from fulcrum.sim.scenario.phases import Phase
from fulcrum.synthesis import InvalidInputError

ROOT = Path(__file__).parents[1]
# A third of the box's tilt, from hands that are near: 3.2 s.
PHASES = (
    Phase("touch", 0.2, tilt=0.0, gap=0.0, grip=0.0),
    Phase("grip", 0.4, tilt=0.0, gap=0.0, grip=1.0),
    Phase("tilt", 2.6, tilt=1.0, gap=0.0, grip=1.0),
)
SCENARIO = scenario("box-tilt")
SCENARIO = replace(
    SCENARIO, standoff=0.002, phases=PHASES, path=replace(SCENARIO.path, angle_deg=30.0)
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    execute(Request(SCENARIO, "margin", SCENARIO.control, out=folder))
    return folder / "run.rrd"


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
    for at_s in (0.5, 3.1):
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
    with pytest.raises(InvalidInputError, match=r"--at: got 99 s; valid is 0 to 3\.199 s"):
        screenshot(recording, 99.0, tmp_path / "x.png")
    assert list(tmp_path.iterdir()) == []


def test_a_machine_without_vulkan_is_told_what_to_install(recording, tmp_path):
    nothing = {"VK_DRIVER_FILES": os.devnull, "VK_ICD_FILENAMES": os.devnull}
    out = tmp_path / "x.png"
    arguments = ["screenshot", str(recording), "--at", "1", "--out", str(out)]
    done = subprocess.run(
        [sys.executable, "-m", "fulcrum.scenarios.cli", *arguments],
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
