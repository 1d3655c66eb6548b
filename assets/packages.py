"""Paths of the files that a robot's description names, which must be in its package."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

MANIFEST = "package.xml"
"""File in the root folder of a ROS package, with the package's name."""
DESCRIPTION_FOLDERS = ("urdf", "robots", "mjcf")
"""Folders of a package with descriptions; without a manifest their parent is the package."""
_PACKAGE, _FILE = "package://", "file://"
# Attributes of an MJCF compiler that name folders with files.
_FOLDERS = ("assetdir", "meshdir", "texturedir")


class ModelError(ValueError):
    """A model of a robot or hand is not valid."""

    def __init__(self, given: str, valid: str) -> None:
        self.given, self.valid = " ".join(given.split()), valid
        super().__init__(f"model: got {self.given}; valid is {valid}.")


def package_root(description: Path) -> Path:
    """Return the folder of a description's package, outside of which it may not name files."""
    folder = description.resolve().parent
    for candidate in (folder, *folder.parents):
        if (candidate / MANIFEST).is_file():
            return candidate
    return folder.parent if folder.name in DESCRIPTION_FOLDERS else folder


def named_file(uri: str, description: Path) -> Path:
    """Return the path of a file that a URDF names: ``package://``, or relative to the URDF.

    Raises:
        ModelError: The file is missing, outside of the URDF's package or in another package.
    """
    root = package_root(description)
    if uri.startswith(_PACKAGE):
        package, _, relative = uri.removeprefix(_PACKAGE).partition("/")
        names = _names(root)
        if package not in names:
            raise ModelError(f"file {uri}", f"one in the package {' or '.join(names)} of the model")
        path = root / relative
    else:
        path = description.parent / uri.removeprefix(_FILE)
    path = path.resolve()
    if not path.is_relative_to(root):
        raise _outside(uri, root)
    if not path.is_file():
        raise ModelError(f"file {uri}, which is missing", f"a file below {root.name}")
    return path


def check_files(mjcf: Path) -> None:
    """Check that an MJCF file and those that it includes name only files in its package.

    Raises:
        ModelError: A file is outside the package, or is not XML.
    """
    root = package_root(mjcf)
    files, seen = [mjcf.resolve()], set()
    while files:
        file = files.pop()
        seen.add(file)
        for tag, name, folders in _named(read_xml(file)):
            for folder in folders:
                path = (mjcf.parent / folder / name).resolve()
                if not path.is_relative_to(root):
                    raise _outside(name, root)
                if tag in ("include", "model") and path.is_file() and path not in seen:
                    files.append(path)


def read_xml(file: Path) -> ET.Element:
    """Return the root element of an XML file.

    Raises:
        ModelError: The file cannot be read, or is not XML.
    """
    try:
        return ET.fromstring(file.read_bytes())
    except (ET.ParseError, OSError, ValueError, LookupError) as error:
        raise ModelError(f"{file.name} ({error})", "a URDF or MJCF file") from None


def _names(root: Path) -> tuple[str, ...]:
    """Return the names of a package: that of its folder, and that in its manifest."""
    manifest = root / MANIFEST
    stated = read_xml(manifest).findtext("name", "").strip() if manifest.is_file() else ""
    return tuple(dict.fromkeys(name for name in (root.name, stated) if name))


def _outside(name: str, root: Path) -> ModelError:
    return ModelError(f"file {name}", f"a file below {root.name}, the model's folder")


def _named(mjcf: ET.Element) -> Iterator[tuple[str, str, set[str]]]:
    """Yield tag and name of each file that an MJCF names, and the folders in which it may be."""
    stated = {compiler.get(key, "") for compiler in mjcf.iter("compiler") for key in _FOLDERS}
    for element in mjcf.iter():
        for key, value in element.attrib.items():
            if key.startswith("file"):
                yield str(element.tag), value, {"", *stated}
