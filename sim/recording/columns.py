"""Columns of a recording straight from arrays, which rerun would take several times as long for."""

from __future__ import annotations

import numpy as np
import rerun as rr
from rerun import components

from fulcrum.synthesis.arrays import Array

_SCALARS = rr.Scalars.descriptor_scalars()
_TRANSLATION = rr.Transform3D.descriptor_translation()
_QUATERNION = rr.Transform3D.descriptor_quaternion()
_CHILD_FRAME = rr.Transform3D.descriptor_child_frame()
_VECTORS, _ORIGINS = rr.Arrows3D.descriptor_vectors(), rr.Arrows3D.descriptor_origins()
_STRIPS = rr.LineStrips3D.descriptor_strips()


def scalars(values: Array) -> list[rr.ComponentColumn]:
    """Values of s series at k times, (k, s)."""
    return [_column(_SCALARS, components.ScalarBatch(values.ravel()), *values.shape)]


def poses(frames: list[str], positions: Array, quaternions: Array) -> list[rr.ComponentColumn]:
    """Poses, one per row: k frames, their positions, (k, 3), and quaternions xyzw, (k, 4)."""
    return [
        rr.ComponentColumn(_CHILD_FRAME, components.TransformFrameIdBatch(frames)),
        rr.ComponentColumn(_TRANSLATION, components.Translation3DBatch(positions)),
        rr.ComponentColumn(_QUATERNION, components.RotationQuatBatch(quaternions)),
    ]


def arrows(origins: Array, vectors: Array) -> list[rr.ComponentColumn]:
    """m arrows at k times: origins and vectors, (k, m, 3)."""
    shape = origins.shape[:2]
    return [
        _column(_VECTORS, components.Vector3DBatch(vectors.reshape(-1, 3)), *shape),
        _column(_ORIGINS, components.Position3DBatch(origins.reshape(-1, 3)), *shape),
    ]


def strips(points: Array) -> list[rr.ComponentColumn]:
    """m line strips at k times: the p points of each, (k, m, p, 3)."""
    batch = components.LineStrip3DBatch(points.reshape(-1, *points.shape[2:]))
    return [_column(_STRIPS, batch, *points.shape[:2])]


def _column(
    descriptor: rr.ComponentDescriptor, batch: rr.ComponentBatchLike, rows: int, width: int
) -> rr.ComponentColumn:
    """A column of rows that hold so many values each."""
    offsets = width * np.arange(rows + 1, dtype=np.int32)
    return rr.ComponentColumn(descriptor, batch, offsets=offsets)
