"""Quaternions one at a time are those of MuJoCo's engine and of SciPy."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import quaternion

SAMPLES = 200
# Sums of four products of numbers below 1; SciPy orders them otherwise.
ROUNDING = 1e-14


def pairs(near=False):
    """Pairs of random unit quaternions, the second near the first or anywhere."""
    rng = np.random.default_rng(0)
    for _ in range(SAMPLES):
        p = rng.normal(size=4)
        q = p + 1e-4 * rng.normal(size=4) if near else rng.normal(size=4)
        yield p / np.linalg.norm(p), q / np.linalg.norm(q)


def by_mujoco(function, shape, *arguments):
    found = np.empty(shape)
    function(found.reshape(-1), *arguments)
    return found


def test_a_matrix_a_product_and_a_turned_vector_are_mujoco_s_to_the_last_bit():
    vector = np.array([0.3, -0.2, 0.9])
    for p, q in pairs():
        expected = by_mujoco(mujoco.mju_quat2Mat, (3, 3), q)
        np.testing.assert_array_equal(quaternion.matrix(q), expected)
        expected = by_mujoco(mujoco.mju_mulQuat, 4, p, q)
        np.testing.assert_array_equal(quaternion.product(p, q), expected)
        expected = by_mujoco(mujoco.mju_rotVecQuat, 3, vector, q)
        np.testing.assert_array_equal(quaternion.rotated(q, vector), expected)


@pytest.mark.parametrize("near", [False, True])
def test_a_difference_turns_one_into_the_other(near):
    for p, q in pairs(near):
        rotvec = quaternion.difference(p, q)
        there = Rotation.from_quat(quaternion.turned(q, rotvec), scalar_first=True)
        off = (there.inv() * Rotation.from_quat(p, scalar_first=True)).magnitude()
        # Half angles come from an arc tangent of numbers of rounding's accuracy.
        assert off < 1e-12
        half = Rotation.from_quat(quaternion.turned(q, rotvec, 0.5), scalar_first=True)
        rest = (half.inv() * there).magnitude()
        assert rest == pytest.approx(0.5 * np.linalg.norm(rotvec), abs=1e-12)


def test_the_inverse_turns_back_and_another_does_not():
    for p, q in pairs():
        none = quaternion.product(q, quaternion.inverse(q))
        np.testing.assert_allclose(none, [1.0, 0.0, 0.0, 0.0], rtol=0, atol=ROUNDING)
        assert np.abs(quaternion.product(p, quaternion.inverse(q))[1:]).max() > 1e-3


def test_any_length_is_normalised_and_none_is_no_turn():
    q = np.array([0.6, 0.0, -0.8, 0.0])
    for length in (1e-12, 1.3, 1e150):
        np.testing.assert_allclose(quaternion.normalized(length * q), q, rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(quaternion.normalized(1e-160 * q), [1.0, 0.0, 0.0, 0.0])
