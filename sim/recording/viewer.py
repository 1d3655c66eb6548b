"""Display of recordings: in the viewer, or as a picture of one moment without a screen."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from rerun.experimental import ViewerClient

from fulcrum.sim.recording.blueprint import TIMELINE
from fulcrum.sim.recording.cut import MAGIC, readable
from fulcrum.synthesis import FulcrumError, InvalidInputError

_PACKAGES = "mesa-vulkan-drivers libvulkan1 libegl1 libegl-mesa0 libgl1-mesa-dri"
_NO_WINDOW = "the Rerun viewer could not open a window on this machine."
_NO_DRAWING = (
    "screenshot: the headless viewer did not start or broke off; it needs a Vulkan driver "
    f"(Debian: apt-get install {_PACKAGES})."
)
_RERUN = (sys.executable, "-m", "rerun")
_SIZE = "1920x1080"
_LOADING_S = 60.0
_POLL_S = 0.2
# The viewer loads data only when it draws them. So a picture is taken when it has not changed for
# _SETTLED_S, and at the deadline at the latest [s].
_SETTLED_S, _DEADLINE_S, _PAINT_S = 1.5, 20.0, 0.5


class ViewerError(FulcrumError):
    """The viewer cannot show the recording on this machine."""


def recording_file(run: Path) -> Path:
    """Return the recording of a run, given its folder or the file itself.

    Raises:
        InvalidInputError: There is no recording.
    """
    path = run / "run.rrd" if run.is_dir() else run
    if path.suffix != ".rrd" or not path.is_file() or not _is_recording(path):
        raise InvalidInputError(
            "recording", str(run), "a folder that `fulcrum run` wrote, or an .rrd file"
        )
    return path


def _is_recording(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def view(run: Path) -> None:
    """Open a recording in the Rerun viewer; return when the viewer is closed."""
    with readable(recording_file(run)) as path:
        command = [*_RERUN, str(path)]
        if subprocess.run(command, check=False, stderr=subprocess.DEVNULL).returncode != 0:
            raise ViewerError(f"view: {_NO_WINDOW}")


def open_viewer() -> str:
    """Open an empty viewer that outlives this process, and return the URL to stream to.

    Raises:
        ViewerError: This machine cannot show a window.
    """
    process, url = _start("--hide-welcome-screen")
    if _connect(process, url) is None:
        raise ViewerError(f"--live: {_NO_WINDOW}")
    return url


def screenshot(run: Path, at_s: float, picture: Path) -> None:
    """Write a picture of a recording in its initial layout; no screen is needed.

    Args:
        run: Folder of the run, or its recording.
        at_s: Moment that the picture shows [s].
        picture: PNG file to write.

    Raises:
        InvalidInputError: There is no such recording, or the moment lies outside it.
        ViewerError: This machine cannot draw.
    """
    with readable(recording_file(run)) as path, headless_viewer() as client:
        client.open(str(path.resolve()))
        start, end = _time_range(client)
        if not start <= at_s <= end:
            raise InvalidInputError("--at", f"{at_s:g} s", f"{start:g} to {end:.3f} s")
        client.set_time(TIMELINE, duration=at_s, play_state="paused")
        picture.write_bytes(_settled_picture(client))


@contextlib.contextmanager
def headless_viewer() -> Iterator[ViewerClient]:
    """Yield a viewer without a window, which is closed at the end.

    Raises:
        ViewerError: This machine cannot draw.
    """
    process, url = _start("--headless", "--window-size", _SIZE)
    try:
        client = _connect(process, url)
        if client is None:
            raise ViewerError(_NO_DRAWING)
        yield client
    except (RuntimeError, ConnectionError) as died:
        raise ViewerError(_NO_DRAWING) from died
    finally:
        # The viewer is a child of the process that was started: both must be ended.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _start(*options: str) -> tuple[subprocess.Popen[bytes], str]:
    """Start a viewer process in its own group without a log; return it and its URL."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [*_RERUN, "--bind", "127.0.0.1", "--port", str(port), *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    return process, f"rerun+http://127.0.0.1:{port}/proxy"


def _connect(process: subprocess.Popen[bytes], url: str) -> ViewerClient | None:
    """Return a client as soon as the viewer answers; None if it never does."""
    deadline = time.monotonic() + _LOADING_S
    while process.poll() is None and time.monotonic() < deadline:
        # The client raises RuntimeError until the viewer is ready.
        with contextlib.suppress(RuntimeError, ConnectionError):
            client = ViewerClient.connect(url)
            client.get_state()
            return client
        time.sleep(_POLL_S)
    return None


def _settled_picture(client: ViewerClient) -> bytes:
    """Return the viewer's picture as soon as it has stopped changing."""
    deadline = time.monotonic() + _DEADLINE_S
    last, since = client.take_screenshot(), time.monotonic()
    while time.monotonic() < deadline and time.monotonic() - since < _SETTLED_S:
        time.sleep(_PAINT_S)
        picture = client.take_screenshot()
        if picture != last:
            last, since = picture, time.monotonic()
    return last


def _time_range(client: ViewerClient) -> tuple[float, float]:
    """Wait until the recording is loaded, and return its first and last moment [s]."""
    deadline = time.monotonic() + _LOADING_S
    while time.monotonic() < deadline:
        state = client.get_state()
        for recording in state.recordings:
            for timeline in recording.timelines:
                if timeline.name == TIMELINE and timeline.end is not None and not state.loading:
                    return 1e-9 * timeline.start, 1e-9 * timeline.end
        time.sleep(_POLL_S)
    raise ViewerError(f"screenshot: the recording was not loaded within {_LOADING_S:g} s.")
