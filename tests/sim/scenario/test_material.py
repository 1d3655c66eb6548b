"""Contacts as a bench measures them."""

import math

import pytest

from fulcrum.sim.scenario.material import PAD, ContactMaterial
from fulcrum.synthesis import InvalidInputError


def test_stiffness_by_hertz_is_the_slope_of_its_force_over_depth():
    modulus, radius, load, poisson = 3e6, 0.02, 40.0, 0.4
    material = ContactMaterial.hertz(modulus, radius, load, damping_s=0.001, poisson=poisson)
    effective = modulus / (1.0 - poisson**2)

    def force(depth):
        return 4.0 / 3.0 * effective * math.sqrt(radius) * depth**1.5

    depth = (0.75 * load / (effective * math.sqrt(radius))) ** (2.0 / 3.0)
    slope = (force(1.001 * depth) - force(0.999 * depth)) / (0.002 * depth)
    # Central differences of a thousandth are off by 1e-7 of the slope.
    assert material.stiffness == pytest.approx(slope, rel=1e-6)
    assert force(depth) == pytest.approx(load, rel=1e-12)


def test_usual_pad_is_a_ball_of_soft_rubber():
    assert ContactMaterial.hertz(2e6, 0.03, 50.0, PAD.damping_s).stiffness == pytest.approx(
        PAD.stiffness, rel=1e-3
    )


def test_scaled_contact_keeps_its_time_constant():
    scaled = PAD.scaled(0.5)
    assert (scaled.stiffness, scaled.damping) == (PAD.stiffness / 2.0, PAD.damping / 2.0)


@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("material.stiffness", lambda: ContactMaterial(0.0, 0.002)),
        ("material.damping_s", lambda: ContactMaterial(4e4, -0.002)),
        ("material.modulus", lambda: ContactMaterial.hertz(0.0, 0.03, 50.0, 0.002)),
        ("material.poisson", lambda: ContactMaterial.hertz(2e6, 0.03, 50.0, 0.002, 0.6)),
    ],
)
def test_values_that_no_material_has_are_refused(field, make):
    with pytest.raises(InvalidInputError, match=f"^{field}"):
        make()
