"""Operations on single quaternions wxyz, for controller and sensors at every tick.

Plain Python is several times faster here than SciPy; the arithmetic is that of MuJoCo's engine.
For many quaternions at once use :class:`scipy.spatial.transform.Rotation`.
"""

from __future__ import annotations

import math

import numpy as np

from fulcrum.synthesis.arrays import Array

# Lengths within this distance of 1 count as 1, and below it as 0.
_ROUNDING = 1e-15


def matrix(q: Array) -> Array:
    """Return the rotation matrix, (3, 3), of a unit quaternion, (4,)."""
    w, x, y, z = q.tolist()
    xy, wz, xz, wy, yz, wx = x * y, w * z, x * z, w * y, y * z, w * x
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return np.array(
        [
            [ww + xx - yy - zz, 2.0 * (xy - wz), 2.0 * (xz + wy)],
            [2.0 * (xy + wz), ww - xx + yy - zz, 2.0 * (yz - wx)],
            [2.0 * (xz - wy), 2.0 * (yz + wx), ww - xx - yy + zz],
        ]
    )


def product(p: Array, q: Array) -> Array:
    """Return the rotation q followed by p, (4,) each."""
    a, b, c, d = p.tolist()
    w, x, y, z = q.tolist()
    return np.array(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ]
    )


def inverse(q: Array) -> Array:
    """Return the inverse of a unit quaternion, (4,)."""
    return q * (1.0, -1.0, -1.0, -1.0)


def normalized(q: Array) -> Array:
    """Return the quaternion scaled to length 1, (4,); the identity if its length is 0."""
    w, x, y, z = q.tolist()
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if length < _ROUNDING:
        return np.array([1.0, 0.0, 0.0, 0.0])
    return q if abs(length - 1.0) <= _ROUNDING else q * (1.0 / length)


def rotated(q: Array, vector: Array) -> Array:
    """Return a vector, (3,), turned by a unit quaternion, (4,)."""
    w, x, y, z = q.tolist()
    a, b, c = vector.tolist()
    u, v, t = w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a
    return np.array(
        [
            a + 2.0 * (y * t - z * v),
            b + 2.0 * (z * u - x * t),
            c + 2.0 * (x * v - y * u),
        ]
    )


def about(axis: Array, angle: float) -> Array:
    """Return the quaternion, (4,), of a turn by an angle [rad] about a unit axis, (3,)."""
    x, y, z = axis.tolist()
    sine = math.sin(0.5 * angle)
    return np.array([math.cos(0.5 * angle), x * sine, y * sine, z * sine])


def difference(p: Array, q: Array) -> Array:
    """Return the rotation vector [rad], (3,), in q's axes, that turns q into p, (4,) each."""
    turn = product(inverse(q), p)
    sine, axis = _direction(turn[1:])
    angle = 2.0 * math.atan2(sine, turn[0])
    return axis * (angle if angle <= math.pi else angle - 2.0 * math.pi)


def turned(q: Array, rotvec: Array, share: float = 1.0) -> Array:
    """Return q, (4,), turned by `share` of a rotation vector [rad], (3,), in q's axes."""
    angle, axis = _direction(rotvec)
    return product(normalized(q), about(axis, share * angle))


def _direction(vector: Array) -> tuple[float, Array]:
    """Return the length and the unit direction, (3,), of a vector; zeros for a zero vector."""
    x, y, z = vector.tolist()
    length = math.sqrt(x * x + y * y + z * z)
    return length, vector * (1.0 / length) if length > 0.0 else np.zeros(3)
