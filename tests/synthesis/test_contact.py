"""Contact models, grasp maps and friction utilisation."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.synthesis import Contact, ContactModel, InvalidInputError, Role
from fulcrum.synthesis.contact import grasp_maps, skew, utilisation

SFCE = Contact("pad", Role.HAND, ContactModel.SFCE, mu=0.5, e_t=2.0, e_o=0.5, e_n=0.1)
PCWF = Contact("edge", Role.ENVIRONMENT, ContactModel.PCWF, mu=0.5, e_t=2.0, e_o=0.5)
SMOOTH = Contact("ball", Role.ENVIRONMENT, ContactModel.FRICTIONLESS)


def test_skew_matrix_times_vector_is_the_cross_product():
    rng = np.random.default_rng(0)
    p, z = rng.normal(size=(2, 5, 3))
    # Two roundings of sums of products near one.
    np.testing.assert_allclose(np.einsum("ijk,ik->ij", skew(p), z), np.cross(p, z), atol=1e-15)


def test_grasp_map_moves_a_wrench_to_the_origin():
    rng = np.random.default_rng(1)
    R = Rotation.random(4, rng=rng).as_matrix()
    p = rng.normal(size=(4, 3))
    w_C = rng.normal(size=(4, 6))
    for G, R_i, p_i, w in zip(grasp_maps(R, p), R, p, w_C, strict=True):
        force, moment = R_i @ w[:3], R_i @ w[3:]
        expected = np.concatenate([force, moment + np.cross(p_i, force)])
        # A dozen roundings of numbers near one.
        np.testing.assert_allclose(G @ w, expected, atol=1e-14)


@pytest.mark.parametrize(
    ("contact", "count"), [(SMOOTH, 1), (PCWF, 3), (SFCE, 4)], ids=lambda c: getattr(c, "name", "")
)
def test_model_transmits_its_components_with_the_normal_first(contact, count):
    assert len(contact.model.components) == len(contact.scale) == count
    assert contact.model.components[0] == 2
    assert contact.scale[0] == 1.0


@pytest.mark.parametrize("axis", range(3))
def test_each_semi_axis_of_the_soft_finger_cone_has_utilisation_one(axis):
    component = (0, 1, 5)[axis]
    w = np.zeros((1, 6))
    w[0, 2] = 10.0
    w[0, component] = 10.0 * 0.5 * (2.0, 0.5, 0.1)[axis]
    # One division by an inexact scale.
    assert utilisation((SFCE,), w)[0] == pytest.approx(1.0, rel=1e-15)
    w[0, component] *= 2.0
    assert utilisation((SFCE,), w)[0] == pytest.approx(2.0, rel=1e-15)


def test_utilisation_is_zero_unloaded_and_infinite_for_friction_without_a_normal_force():
    w = np.zeros((3, 6))
    assert (utilisation((SFCE, PCWF, SMOOTH), w) == 0.0).all()
    w[:, 0] = 1.0
    assert utilisation((SFCE, PCWF, SMOOTH), w).tolist() == [math.inf, math.inf, 0.0]


def test_utilisation_broadcasts_over_time():
    w = np.random.default_rng(2).uniform(0.1, 1.0, size=(7, 3, 6))
    contacts = (SFCE, PCWF, SMOOTH)
    expected = [utilisation(contacts, sample) for sample in w]
    np.testing.assert_array_equal(utilisation(contacts, w), expected)


@pytest.mark.parametrize("field", ["mu", "e_t", "e_o", "e_n"])
@pytest.mark.parametrize("value", [0.0, -0.1, math.nan, math.inf])
def test_friction_parameter_that_is_not_positive_and_finite_is_refused(field, value):
    parameters = {"mu": 0.1, field: value}
    with pytest.raises(InvalidInputError, match=f"contact pad.{field}: got {value}"):
        Contact("pad", Role.HAND, ContactModel.SFCE, **parameters)


def test_missing_friction_points_to_the_frictionless_model():
    with pytest.raises(InvalidInputError, match="model frictionless"):
        Contact("edge", Role.ENVIRONMENT, ContactModel.PCWF)


@pytest.mark.parametrize(
    ("limits", "field"),
    [
        ({"f_n_min": -1.0}, "f_n_min"),
        ({"f_n_min": math.nan}, "f_n_min"),
        ({"f_n_min": math.inf}, "f_n_min"),
        ({"f_n_max": -1.0}, "f_n_max"),
        ({"f_n_max": math.nan}, "f_n_max"),
        ({"f_n_min": 2.0, "f_n_max": 1.0}, "f_n_max"),
    ],
)
def test_senseless_normal_force_bound_is_refused(limits, field):
    with pytest.raises(InvalidInputError, match=rf"contact ball\.{field}"):
        Contact("ball", Role.HAND, ContactModel.FRICTIONLESS, **limits)


def test_nameless_contact_is_refused():
    with pytest.raises(InvalidInputError, match=r"contact\.name"):
        Contact("", Role.HAND, ContactModel.FRICTIONLESS)
