"""Cache, in the user's cache folder, of arrays that take long to make."""

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
    """Return the arrays of a key from the cache, or make them if the cache cannot be used.

    Args:
        key: Digest of everything that determines the arrays; the name of the file.
        make: Function that makes the arrays.
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
        # Renaming makes the file complete or absent, even if another process writes it.
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            np.savez(file, *arrays)
        Path(file.name).replace(path)
    return arrays


def folder() -> Path | None:
    """Return the cache folder of the XDG base directory specification; None without a home."""
    root = os.environ.get("XDG_CACHE_HOME")
    try:
        return Path(root or Path.home() / ".cache") / "fulcrum"
    except RuntimeError:  # unknown user without HOME
        return None
