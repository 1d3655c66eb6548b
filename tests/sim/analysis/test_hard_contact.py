"""Hard contacts of Pinocchio: against weight, Coulomb's cone, and MuJoCo's forces along a run."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.analysis.hard_contact import HardContacts, static_differences
from fulcrum.sim.geometry.object import GRAVITY
from fulcrum.sim.run.execute import Request, execute

BOX = scenario("panda-box")


@pytest.fixture(scope="module")
def run():
    return execute(Request(BOX, "margin", best_effort=True))


def test_mujocos_forces_are_those_of_hard_contacts_where_they_are_determined(run):
    found = static_differences(BOX, run.trace, run.history)
    for name, off in found.items():
        assert off.solved == 1.0
        # MuJoCo's contacts yield, so that the object swings on them by some micrometres. (Where a
        # faster tilt makes them bounce, the two differ by newtons.)
        # Measured with pads of 4e4 N/m: 0.03 and 0.07 N of 40 N at the hands, 0.16 and 0.21 N of
        # 30 N at the edge.
        bound = 0.006 if name.startswith("edge") else 0.0015
        assert off.normal_rms_n < bound * off.peak_n, name
        assert off.tangential_rms_n < 1.4 * bound * off.peak_n, name
    hands = [found[hand.name] for hand in BOX.hands]
    assert all(hand.determined == 1.0 for hand in hands)
    # Two supports on one edge may press on each other along it.
    assert found["edge_left"].determined == pytest.approx(2.0 / 3.0)


def test_a_torque_that_was_not_applied_is_caught(run):
    tau = run.trace.tau.copy()
    tau[:, 1] += 2.0
    trace = replace(run.trace, tau=tau)
    found = static_differences(BOX, trace, run.history)
    assert found["left"].normal_rms_n > 0.02 * found["left"].peak_n


def test_a_lone_object_is_carried_by_what_touches_it(run):
    rows = np.flatnonzero(run.trace.phase == 0)[-1:]
    trace = run.trace
    lone = replace(trace, f_W=trace.f_W.copy(), tau=trace.tau.copy())
    forces = HardContacts(BOX).forces(lone, rows).f_C[0]
    # Before the hands come, the named edge alone cannot carry the object: it falls about it, and
    # a rod that is let go level presses with a quarter of its weight and more of its size.
    assert 0.0 < forces[2:, 2].sum() < BOX.object.mass * GRAVITY
    np.testing.assert_array_equal(forces[:2], 0.0)


def test_friction_stays_in_the_cone(run):
    slippery = replace(
        BOX,
        hands=tuple(replace(hand, friction=replace(hand.friction, mu=0.05)) for hand in BOX.hands),
    )
    rows = np.flatnonzero(run.trace.phase == 3)[::200]
    forces = HardContacts(slippery).forces(run.trace, rows).f_C[:, :2]
    assert np.isfinite(forces).all()
    across = np.linalg.norm(forces[..., :2], axis=-1)
    assert (across <= 0.05 * forces[..., 2] + 1e-6).all()
    assert (across > 0.049 * forces[..., 2]).any()
