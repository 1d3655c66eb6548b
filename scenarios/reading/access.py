"""Files that a scenario file may have read, and where they may be."""

from __future__ import annotations

from pathlib import Path

from fulcrum.assets.packages import package_root
from fulcrum.scenarios.reading.source import KeyPath, Source, nearest


class Access:
    """Where a scenario file may read: its own folder, and what the command line allows."""

    def __init__(self, source: Source, allowed: tuple[Path, ...]) -> None:
        self._source, self._folder = source, source.file.absolute().parent
        self._allowed = tuple(folder.resolve() for folder in (self._folder, *allowed))

    def file(self, key: KeyPath, given: str, what: str) -> Path:
        """The file that a key names, relative to the scenario file.

        Raises:
            FileError: It is elsewhere, or there is none.
        """
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
        """A model that ships, by its name, or the path of the file that a key names.

        Raises:
            FileError: There is neither, or its package reaches beyond the folders allowed.
        """
        if given in shipped:
            return given
        if "." not in given and "/" not in given:
            valid = f"{nearest(given, list(shipped))}; or {what}"
            raise self._source.error(key, f'"{given}"', valid)
        file = self.file(key, given, what)
        root = package_root(file)
        if not any(root.is_relative_to(folder) for folder in self._allowed):
            valid = f"{what} whose package {root} is given with --allow-path, as it may read there"
            raise self._source.error(key, given, valid)
        return str(file)
