"""Output folders and JSON files, for all parts of fulcrum."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
from pathlib import Path
from typing import Any

from fulcrum.synthesis import InvalidInputError


def check_new_folder(field: str, out: Path) -> None:
    """Check that a folder is empty or can be made.

    Args:
        field: Name of the setting, for the message.
        out: Folder.

    Raises:
        InvalidInputError: The folder is not empty, or cannot be made or written to.
    """
    nearest = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not nearest.is_dir() or (out.exists() and any(out.iterdir())):
        raise InvalidInputError(field, str(out), "a new or empty folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        given = f"{out}, where nothing may be written"
        raise InvalidInputError(field, given, "a folder that may be written to")


def claim_folder(folder: Path) -> Path:
    """Make a folder that did not exist, and return it; -2, -3, .. is added to a name in use."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    for number in itertools.count(1):
        claimed = folder if number == 1 else folder.with_name(f"{folder.name}-{number}")
        with contextlib.suppress(FileExistsError):
            claimed.mkdir()
            return claimed
    raise AssertionError("an endless count has ended")


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file; infinite and undefined numbers, which JSON does not know, become null."""
    path.write_text(json.dumps(finite(content), indent=2, allow_nan=False) + "\n")


def finite(value: Any) -> Any:
    """Return the value with infinite and undefined numbers, at any depth, replaced by None."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
