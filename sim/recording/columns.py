"""Columns of a recording straight from arrays, which rerun would take several times as long for."""

from __future__ import annotations

import numpy as np
import rerun as rr
from rerun import components

from synthesis.contact import Array

_SCALARS = rr.Scalars.descriptor_scalars()
_TRANSLATION = rr.Transform3D.descriptor_translation()
_QUATERNION = rr.Transform3D.descriptor_quaternion()
_MATRIX = rr.Transform3D.descriptor_mat3x3()
_VECTORS, _ORIGINS = rr.Arrows3D.descriptor_vectors(), rr.Arrows3D.descriptor_origins()


def scalars(values: Array) -> list[rr.ComponentColumn]:
    """Values of s series at k times, (k, s)."""
    rows, series = values.shape
    offsets = series * np.arange(rows + 1, dtype=np.int32)
    batch = components.ScalarBatch(values.ravel())
    return [rr.ComponentColumn(_SCALARS, batch, offsets=offsets)]


def poses(positions: Array, quaternions: Array) -> list[rr.ComponentColumn]:
    """Poses at k times: positions, (k, 3), and quaternions xyzw, (k, 4)."""
    return [
        rr.ComponentColumn(_TRANSLATION, components.Translation3DBatch(positions)),
        rr.ComponentColumn(_QUATERNION, components.RotationQuatBatch(quaternions)),
    ]


def frames(positions: Array, matrices: Array) -> list[rr.ComponentColumn]:
    """Poses at k times: positions, (k, 3), and rotation matrices, (k, 3, 3)."""
    return [
        rr.ComponentColumn(_TRANSLATION, components.Translation3DBatch(positions)),
        rr.ComponentColumn(_MATRIX, components.TransformMat3x3Batch(matrices)),
    ]


def arrows(origins: Array, vectors: Array) -> list[rr.ComponentColumn]:
    """One arrow at k times: origins and vectors, (k, 3)."""
    return [
        rr.ComponentColumn(_VECTORS, components.Vector3DBatch(vectors)),
        rr.ComponentColumn(_ORIGINS, components.Position3DBatch(origins)),
    ]
