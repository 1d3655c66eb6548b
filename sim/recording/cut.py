"""Repair of recordings whose writer ended in the middle of a message.

A recording is a header and a chain of messages. Each message begins with its kind and its length.
The last message marks the end and is followed by a footer. Rerun refuses a file that ends within a
message.
"""

from __future__ import annotations

import contextlib
import shutil
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

MAGIC = b"RRF2"  # first bytes of a recording
_HEADER = 12  # bytes: magic, version, options
_LEAD = struct.Struct("<QQ")  # kind and length of a message
_END = 0  # kind of the message that marks the end


def whole_bytes(path: Path) -> int:
    """Return the size up to the end of the last whole message [bytes]; all of a finished file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        end = _HEADER
        while end + _LEAD.size <= size:
            file.seek(end)
            kind, length = _LEAD.unpack(file.read(_LEAD.size))
            if kind == _END:
                return size
            if end + _LEAD.size + length > size:
                break
            end += _LEAD.size + length
    return min(end, size)


@contextlib.contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Yield the recording if it ends with a whole message, else a copy of its whole messages.

    The file itself is not changed, as another process may still be writing it.
    """
    whole = whole_bytes(path)
    if whole == path.stat().st_size:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        with path.open("rb") as source, copy.open("wb") as target:
            shutil.copyfileobj(source, target)
            target.truncate(whole)
        yield copy
