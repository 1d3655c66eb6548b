"""Files that a scenario file names; raises FileError if they are missing or out of reach."""

from __future__ import annotations

from pathlib import Path

from fulcrum.assets.packages import package_root
from fulcrum.scenarios.reading.source import KeyPath, Source, nearest


class Access:
    """The folders a scenario file may read from: its own, and those the command line allows."""

    def __init__(self, source: Source, allowed: tuple[Path, ...]) -> None:
        self._source, self._folder = source, source.file.absolute().parent
        self._allowed = tuple(folder.resolve() for folder in (self._folder, *allowed))

    def file(self, key: KeyPath, given: str, what: str) -> Path:
        """Return the file that a key names, relative to the scenario file."""
        path = Path(given)
        try:
            found = (self._folder / path).resolve()
            inside = any(found.is_relative_to(folder) for folder in self._allowed)
            plain = ".." not in path.parts and not path.is_absolute()
            exists = inside and found.is_file()
        except (OSError, ValueError):  # a name that is too long, or has a zero in it
            raise self._source.error(key, given, what) from None
        if not inside or (not plain and len(self._allowed) == 1):
            valid = f"{what} in or below {self._source.file.parent}, or in a folder given with "
            raise self._source.error(key, given, f"{valid}--allow-path")
        if not exists:
            raise self._source.error(key, given, f"{what} that exists")
        return found

    def model(self, key: KeyPath, given: str, shipped: tuple[str, ...], what: str) -> str:
        """Return a model that ships by its name, or the path of the file that a key names."""
        if given in shipped:
            return given
        if "." not in given and "/" not in given:
            valid = f"{nearest(given, list(shipped))}; or {what}"
            raise self._source.error(key, f'"{given}"', valid)
        file = self.file(key, given, what)
        root = package_root(file)
        if not any(root.is_relative_to(folder) for folder in self._allowed):
            valid = f"{what} whose package folder {root} is allowed with --allow-path"
            raise self._source.error(key, given, valid)
        return str(file)
