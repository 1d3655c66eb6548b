"""What a scenario file may say of how contacts give way."""

import pytest

from fulcrum.sim.scenario.material import PAD, SUPPORT, ContactMaterial
from tests.helpers.broken_files import LEFT_TIP
from tests.helpers.scenario_files import folder as folder
from tests.helpers.scenario_files import said

TABLE = "friction = { mu = 0.4 }"


@pytest.mark.parametrize(
    ("contact", "material"),
    [
        ("{ stiffness_n_per_m = 3e4 }", ContactMaterial(3e4, PAD.damping_s)),
        ("{ damping_s = 0.004 }", ContactMaterial(PAD.stiffness, 0.004)),
        (
            "{ youngs_modulus_pa = 1e6, radius_m = 0.02, load_n = 30, poisson_ratio = 0.4 }",
            ContactMaterial.hertz(1e6, 0.02, 30.0, PAD.damping_s, 0.4),
        ),
    ],
)
def test_a_hand_has_the_contact_of_the_file_and_the_other_the_usual_one(folder, contact, material):
    left, right = said(folder, (LEFT_TIP, f"contact = {contact}\n{LEFT_TIP}")).hands
    assert left.material == material
    assert right.material == PAD


def test_supports_have_the_contact_of_their_surface(folder):
    assert {support.material for support in said(folder).supports} == {SUPPORT}
    supports = said(folder, (TABLE, f"{TABLE}\ncontact.stiffness_n_per_m = 1e5")).supports
    assert {s.material for s in supports} == {ContactMaterial(1e5, SUPPORT.damping_s)}
