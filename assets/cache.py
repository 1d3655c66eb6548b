"""Arrays that take long to make, kept in the user's cache folder."""

from __future__ import annotations

import contextlib
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def cached(key: str, make: Callable[[], list[NDArray]]) -> list[NDArray]:
    """Arrays by a key, which must stand for all that determines them.

    A cache that cannot be read or written costs time, no more.

    Args:
        key: A digest; names the file.
        make: Makes the arrays where the cache has none, or a damaged file.
    """
    kept_in = folder()
    if kept_in is None:
        return make()
    path = kept_in / f"{key}.npz"
    unusable = contextlib.suppress(OSError, ValueError, EOFError, zipfile.BadZipFile)
    with unusable, np.load(path) as stored:
        return [stored[name] for name in stored.files]
    arrays = make()
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        # Complete or absent, whoever else writes it at the same time.
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            np.savez(file, *arrays)
        Path(file.name).replace(path)
    return arrays


def folder() -> Path | None:
    """Return the cache folder of the XDG base directory specification; None without a home."""
    root = os.environ.get("XDG_CACHE_HOME")
    try:
        return Path(root or Path.home() / ".cache") / "fulcrum"
    except RuntimeError:  # an unknown user, and no HOME
        return None
