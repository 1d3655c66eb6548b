"""Pages that are made from the code: scenes with their pictures, commands."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, get_args

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from schema import reference

from fulcrum.scenarios import scenarios
from fulcrum.scenarios.cli import AnyCommand, main
from fulcrum.scenarios.reading.file import schema

_ROOT = Path(__file__).parent.parent.parent
_FILES = """# Scenario files

All keys of a [scenario file](scenario.md), table by table, from the schema that editors read and
that `fulcrum check` checks by.
"""
_COLUMNS = "90"
_NO_PICTURE = (
    "No picture here: MuJoCo found no EGL to draw with when this page was made "
    "(Debian: libegl1 libegl-mesa0 libgl1-mesa-dri)."
)


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages, and the pictures that README shows."""

    def add(path: str, content: str | bytes) -> None:
        files.append(File.generated(config, path, content=content))

    for shown in sorted((_ROOT / "assets").glob("*.png")):
        add(f"assets/{shown.name}", shown.read_bytes())
    add("commands.md", commands())
    add("file.md", f"{_FILES}\n{reference(schema())}")
    drawn = pictures()
    parts = [(_ROOT / "docs" / "scenes.md").read_text()]
    for name, scene in scenarios().items():
        parts += [f"## {name}", ""]
        if name in drawn:
            add(f"scenes/{name}.png", drawn[name])
            parts += [f"![{scene.summary}: start, half-way and end](scenes/{name}.png)", ""]
        else:
            parts += ["!!! note", f"    {_NO_PICTURE}", ""]
        parts += [scene._repr_markdown_(), ""]
    scenes = files.get_file_from_path("scenes.md")
    assert scenes is not None
    scenes.content_string = "\n".join(parts)
    return files


def pictures() -> dict[str, bytes]:
    """Pictures of the scenes by name; none where MuJoCo has nothing to draw with.

    In processes of their own: what MuJoCo and dm_control draw with is settled on import.
    """
    if _python("-c", "import mujoco; mujoco.GLContext(8, 8)").returncode != 0:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        done = _python(str(Path(__file__).with_name("pictures.py")), folder)
        if done.returncode != 0:
            raise PluginError(f"pictures.py: {done.stderr.strip().splitlines()[-1]}")
        return {path.stem: path.read_bytes() for path in Path(folder).glob("*.png")}


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(_ROOT / "src"), "MUJOCO_GL": "egl"}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=_ROOT, env=environment, capture_output=True, text=True)


def commands() -> str:
    """What ``--help`` says of every command."""
    names = [option.__metadata__[0].name for option in get_args(AnyCommand)]
    parts = ["# Commands", "", "What `fulcrum --help` says, and each command's own.", ""]
    for name in ["", *names]:
        parts += [f"## fulcrum {name}".rstrip(), "", "```text", help_of(name), "```", ""]
    return "\n".join(parts)


def help_of(command: str) -> str:
    """The help text of a command, or of all."""
    output = io.StringIO()
    os.environ["COLUMNS"] = _COLUMNS
    with contextlib.redirect_stdout(output), contextlib.suppress(SystemExit):
        main([command, "--help"] if command else ["--help"])
    return output.getvalue().strip()
