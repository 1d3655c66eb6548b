"""Problems are checked when made: every refusal names the field."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.synthesis import ContactModel, InvalidInputError, Objective, Role
from tests.helpers.problems import arms, box


def _spoilt(array, value):
    array = array.copy()
    array.flat[0] = value
    return array


def _environment_only(problem):
    return tuple(replace(c, role=Role.ENVIRONMENT) for c in problem.contacts)


def _smooth(problem):
    return tuple(replace(c, model=ContactModel.FRICTIONLESS) for c in problem.contacts)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda p: {"contacts": (), "R_OC": p.R_OC[:0], "p_OC_O": p.p_OC_O[:0]}, "contacts"),
        (lambda p: {"contacts": (p.contacts[0], *p.contacts[:3])}, "contacts: got left more"),
        (lambda p: {"contacts": _environment_only(p)}, "contacts: got no hand"),
        (
            lambda p: {"contacts": _smooth(p), "objective": Objective.FRICTION_MARGIN},
            "contacts: got no friction",
        ),
        (lambda p: {"R_OC": p.R_OC[:3]}, "R_OC: got shape"),
        (lambda p: {"R_OC": _spoilt(p.R_OC, np.nan)}, "R_OC: got a value"),
        (lambda p: {"R_OC": 1.001 * p.R_OC}, r"R_OC\[left\]"),
        (lambda p: {"R_OC": -p.R_OC}, r"R_OC\[left\]"),
        # Two that keep volume and handedness: a stretch, a shear.
        (
            lambda p: {"R_OC": p.R_OC @ np.diag([1.0 + 2e-6, 1.0 / (1.0 + 2e-6), 1.0])},
            r"R_OC\[left\]",
        ),
        (
            lambda p: {"R_OC": p.R_OC @ [[1.0, 4e-6, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]},
            r"R_OC\[left\]",
        ),
        (lambda p: {"R_OC": p.R_OC * [[[1.0]], [[1.0]], [[-1.0]], [[1.0]]]}, r"R_OC\[edge left\]"),
        (lambda p: {"p_OC_O": p.p_OC_O[:, :2]}, "p_OC_O: got shape"),
        (lambda p: {"p_OC_O": _spoilt(p.p_OC_O, np.inf)}, "p_OC_O: got a value"),
        (lambda p: {"w_ext_O": p.w_ext_O[:3]}, "w_ext_O: got shape"),
        (lambda p: {"w_ext_O": _spoilt(p.w_ext_O, np.nan)}, "w_ext_O: got a value"),
        (lambda p: {"joints": replace(p.joints, J_C=p.joints.J_C[:1])}, "joints.J_C: got 1"),
        *(
            (lambda p, o=o: {"joints": None, "objective": o}, "joints: got None")
            for o in Objective
            if o.needs_joints
        ),
    ],
)
def test_senseless_problem_is_refused(change, field):
    problem = box(joints=arms())
    with pytest.raises(InvalidInputError, match=field):
        replace(problem, **change(problem))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda j: {"names": ("s0",) * 14}, "joints.names: got s0 more"),
        (
            lambda j: {
                "names": (),
                "J_C": j.J_C[:, :, :0],
                **dict.fromkeys(("tau_g", "tau_min", "tau_max"), np.zeros(0)),
            },
            "joints.names: got an empty set",
        ),
        (lambda j: {"J_C": j.J_C[:, :5]}, "joints.J_C: got shape"),
        (lambda j: {"J_C": j.J_C[0]}, "joints.J_C: got shape"),
        (lambda j: {"J_C": _spoilt(j.J_C, np.nan)}, "joints.J_C: got a value"),
        (lambda j: {"tau_g": j.tau_g[:7]}, "joints.tau_g: got shape"),
        (lambda j: {"tau_g": _spoilt(j.tau_g, np.inf)}, "joints.tau_g: got a value"),
        (lambda j: {"tau_min": j.tau_min[:7]}, "joints.tau_min: got shape"),
        (lambda j: {"tau_max": j.tau_max[:7]}, "joints.tau_max: got shape"),
        (lambda j: {"tau_min": _spoilt(j.tau_min, 51.0)}, r"joints.tau_min\[left_0\]: got 51"),
        (lambda j: {"tau_min": _spoilt(j.tau_min, np.nan)}, r"joints.tau_min\[left_0\]: got nan"),
        (lambda j: {"tau_max": _spoilt(j.tau_max, np.nan)}, r"joints.tau_min\[left_0\].*nan"),
        (
            lambda j: dict.fromkeys(("tau_min", "tau_max"), np.full(14, np.inf)),
            r"joints.tau_min\[left_0\]: got inf",
        ),
        (
            lambda j: dict.fromkeys(("tau_min", "tau_max"), np.full(14, -np.inf)),
            r"joints.tau_min\[left_0\]: got -inf",
        ),
    ],
)
def test_senseless_joints_are_refused(change, field):
    joints = arms()
    with pytest.raises(InvalidInputError, match=field):
        replace(joints, **change(joints))


@pytest.mark.parametrize(("field", "value"), [("tau_max", np.inf), ("tau_min", -np.inf),
                                              ("tau_min", 0.0), ("tau_max", 0.0)])  # fmt: skip
def test_torque_utilisation_needs_finite_limits_on_both_sides_of_zero(field, value):
    joints = arms()
    joints = replace(joints, **{field: _spoilt(getattr(joints, field), value)})
    with pytest.raises(InvalidInputError, match=r"joints.tau_min\[left_0\], tau_max"):
        box(joints=joints, objective=Objective.MAX_TORQUE_UTILISATION)
    box(joints=joints, objective=Objective.MAX_TORQUE)


def test_friction_margin_needs_no_hand():
    problem = box()
    contacts = _environment_only(problem)
    assert replace(problem, contacts=contacts, objective=Objective.FRICTION_MARGIN).hands == ()


def test_rotation_from_an_integrated_quaternion_passes():
    # Integration leaves errors of some 1e-8; a scale error of 1e-3 is refused above.
    problem = box()
    assert replace(problem, R_OC=problem.R_OC * (1.0 + 1e-8)).G.shape == (4, 6, 6)


def test_torque_is_jacobian_transposed_times_hand_wrenches_plus_gravity():
    problem = box(joints=arms())
    joints = problem.joints
    w = np.random.default_rng(0).normal(size=(4, 6))
    by_hand = joints.tau_g + joints.J_C[0].T @ w[0] + joints.J_C[1].T @ w[1]
    # Summation order differs: roundings of torques near 10.
    np.testing.assert_allclose(problem.torque(w), by_hand, atol=1e-14)
    np.testing.assert_array_equal(problem.torque(np.zeros((4, 6))), joints.tau_g)
    assert box().torque(w).size == 0
