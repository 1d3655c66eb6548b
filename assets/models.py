"""Robots and hands, by the name of one that ships or from any URDF or MJCF file."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from fulcrum.assets import HANDS, ROBOTS, asset_path, description_path
from fulcrum.assets.cache import cached
from fulcrum.assets.mjcf import tidy
from fulcrum.assets.packages import ModelError, check_files, named_file, read_xml

# Packages that convert URDF to MJCF: another version of one invalidates the cache.
_CONVERTERS = ("mujoco", "numpy", "pycollada", "trimesh")


def robot_spec(model: str) -> mujoco.MjSpec:
    """Return a robot with a motor at each joint; see `fulcrum.assets.mjcf.tidy`.

    Args:
        model: Name of a robot that ships, or path of a URDF or MJCF file.

    Raises:
        ModelError: There is no such robot, or its file is not valid; says why.
    """
    path = _path(model, tuple(ROBOTS))
    spec = _urdf(path) if is_urdf(path) else _mjcf(path)
    tidy(spec)
    return spec


def hand_spec(model: str) -> mujoco.MjSpec:
    """Return a hand.

    Args:
        model: Name of a hand that ships, or path of an MJCF file.

    Raises:
        ModelError: There is no such hand, or MuJoCo cannot read its file.
    """
    return _mjcf(_path(model, HANDS))


def looks_of(model: str) -> Path | None:
    """Return the URDF with the visual meshes of a robot; None if there is none.

    Raises:
        ModelError: There is no such robot.
    """
    if model in ROBOTS:
        description = ROBOTS[model]
        return None if description is None else description_path(description)
    path = _path(model, tuple(ROBOTS))
    return path if is_urdf(path) else None


def is_urdf(path: Path) -> bool:
    """Return whether a robot's file is a URDF, not MJCF.

    Raises:
        ModelError: The file is neither.
    """
    tag = read_xml(path).tag
    if tag not in ("robot", "mujoco"):
        raise ModelError(f"{path.name} with the root element {tag}", "a URDF or MJCF file")
    return tag == "robot"


def _path(model: str, shipped: tuple[str, ...]) -> Path:
    if model in shipped:
        return asset_path(f"{model}.xml")
    if not Path(model).is_file():
        raise ModelError(repr(model), f"one of {', '.join(shipped)}, or the path of a file")
    return Path(model)


def _mjcf(path: Path) -> mujoco.MjSpec:
    check_files(path)
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise ModelError(str(error), "a file that MuJoCo reads") from None


def _urdf(path: Path) -> mujoco.MjSpec:
    """Return the URDF as MJCF, from the cache if neither it nor its meshes have changed."""
    urdf = path.read_text()
    converters = [Path(__file__).with_name(name) for name in ("urdf.py", "meshes.py")]
    versions = [version(name) for name in _CONVERTERS]
    determined_by = [urdf.encode(), *_meshes(path), repr(versions).encode()]
    determined_by += [file.read_bytes() for file in converters]

    def make() -> list[NDArray]:
        from fulcrum.assets.urdf import mjcf_of, text

        try:
            return [np.frombuffer(text(mjcf_of(urdf, path)).encode(), np.uint8)]
        except ModelError:
            raise
        except (ValueError, LookupError) as error:  # an attribute is missing or not a number
            given = f"{path.name} ({type(error).__name__}: {error})"
            raise ModelError(given, "a URDF with all its names and numbers") from None

    (mjcf,) = cached(hashlib.sha256(b"\0".join(determined_by)).hexdigest(), make)
    return mujoco.MjSpec.from_string(mjcf.tobytes().decode())


def _meshes(urdf: Path) -> Iterator[bytes]:
    """Yield the contents of all mesh files that a URDF names and may use."""
    for mesh in read_xml(urdf).iter("mesh"):
        with contextlib.suppress(ModelError):
            yield named_file(mesh.get("filename", ""), urdf).read_bytes()
