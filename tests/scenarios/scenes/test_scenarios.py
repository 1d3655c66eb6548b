"""Every scenario, in closed loop: the object stays in contact without slipping, or is caught.

A new scenario is covered by being there. Runs are shared by name, so that each is made once.
"""

import re
from dataclasses import fields, replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.model.contacts import true_contacts
from fulcrum.sim.run.assembly import closed_loop
from fulcrum.sim.signals.trace import Trace
from fulcrum.synthesis import ContactModel
from fulcrum.synthesis.arrays import N
from tests.helpers.runs import BOX, FAILING, NAMES, THOROUGH, run, settled, violated

# --- the object stays in contact without slipping ---


@pytest.mark.parametrize("name", NAMES)
def test_the_default_controller_passes(name):
    report = run(name, "default").report
    assert report.verdict is Verdict.PASS, report.sentences
    assert report.sentences == ()


@pytest.mark.parametrize("name", NAMES)
def test_the_object_stays_in_contact_without_slipping(name):
    _, trace, history = run(name, "default")
    assert len(trace) == len(history.kept)
    assert np.count_nonzero(settled(name, trace)) > 1000
    assert violated(name, trace, history) == set()


@pytest.mark.parametrize("name", NAMES)
def test_the_friction_utilisation_is_that_of_the_contact_forces(name):
    _, trace, history = run(name, "default")
    rows = settled(name, trace)
    for i, contact in enumerate(true_contacts(scenario(name))):
        f_t, f_o, f_n, _, _, m_n = history.w_measured_C[rows, i].T
        tangential = f_t**2 + f_o**2
        if contact.model is ContactModel.SFCE:
            tangential = tangential + (m_n / contact.e_n) ** 2
        expected = np.sqrt(tangential) / (contact.mu * f_n)
        # The same formula with other rounding; values are of order 1.
        assert np.abs(history.utilisation[rows, i] - expected).max() < 1e-9


@pytest.mark.parametrize(("name", "case"), FAILING)
def test_a_run_that_must_fail_is_caught_by_the_requirements_and_by_the_report(name, case):
    report, trace, history = run(name, case)
    assert report.verdict is Verdict.FAIL
    assert violated(name, trace, history) & {"kept", "slip", "slide"}
    assert violated(name, trace, history) & {"tilt error", "final tilt"}


@pytest.mark.parametrize("name", NAMES)
def test_a_saturated_torque_and_a_failed_synthesis_are_caught(name):
    _, trace, history = run(name, "default")
    saturated, failed = trace.saturated.copy(), trace.failed.copy()
    saturated[-1, 0] = failed[0] = 1.0
    assert violated(name, replace(trace, saturated=saturated), history) == {"torque"}
    assert violated(name, replace(trace, failed=failed), history) == {"synthesis"}


# --- the report says why ---

SENTENCE = re.compile(
    r"Contact (?P<contact>\w+) (?P<what>slipped|slid|let go)\b.*"
    r" at (?P<t>\d+\.\d\d) s \(tilt (?P<tilt>\d+\.\d) deg\)"
)


def lasting(flags):
    """The flags of stretches of more than 5 steps, 5 ms here."""
    kept, start = np.zeros_like(flags), 0
    for end in [*(np.flatnonzero(np.diff(flags)) + 1).tolist(), len(flags)]:
        kept[start:end] = flags[start] and end - start > 5
        start = end
    return kept


def first_row(name, outcome, contact, what):
    """The first settled step at which a contact did what a sentence says of it."""
    s, trace, history = scenario(name), outcome.trace, outcome.history
    i = s.contact_names.index(contact)
    allowed = 1e-3 * s.tolerances.slip_mm
    did = {
        "let go": lasting(settled(name, trace) & (history.w_measured_C[:, i, N] <= 0.0)),
        "slipped": history.slip[:, i] > allowed,
        "slid": history.slide[:, i] > allowed,
    }[what]
    rows = np.flatnonzero(did & settled(name, trace))
    assert rows.size, f"{contact} never {what}"
    return rows[0]


@pytest.mark.parametrize(("name", "case"), [pair for pair in FAILING if pair[1] != "slippery"])
def test_the_report_names_the_contact_that_slipped_or_let_go_with_time_and_tilt(name, case):
    outcome = run(name, case)
    told = [match for f in outcome.report.sentences if (match := SENTENCE.match(f))]
    hands = {hand.name for hand in scenario(name).hands}
    assert hands & {match["contact"] for match in told}
    for match in told:
        row = first_row(name, outcome, match["contact"], match["what"])
        # Half of the last printed digit, and rounding.
        assert float(match["t"]) == pytest.approx(outcome.trace.t[row], abs=0.00501)
        tilt_deg = abs(np.degrees(outcome.trace.tilt[row]))
        assert float(match["tilt"]) == pytest.approx(tilt_deg, abs=0.0501)


@pytest.mark.parametrize("name", NAMES)
def test_the_report_of_a_contact_that_held_says_nothing_of_it(name):
    hand = scenario(name).hands[0].name
    with pytest.raises(AssertionError, match="never let go"):
        first_row(name, run(name, "default"), hand, "let go")


# --- the same seed gives the same run ---


def differing(first, second):
    """Names of the arrays of two traces that are not the same bit by bit."""
    names = [field.name for field in fields(Trace)]
    return {n for n in names if getattr(first, n).tobytes() != getattr(second, n).tobytes()}


@pytest.mark.parametrize("name", THOROUGH)
def test_the_same_seed_gives_the_same_trace_bit_for_bit(name):
    # Only how long a synthesis took is not the run's own.
    assert differing(run(name, "default").trace, run(name, "again").trace) <= {"synthesis_s"}


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_decides_the_trace_from_the_first_step_on(name):
    s = scenario(name)

    def begin(seed):
        """The first 0.3 s of a run."""
        loop = closed_loop(s, s.control, seed=seed)
        blocks = loop.run()
        next(blocks), next(blocks)
        return loop.trace.rows(0, 300)

    default, other = run(name, "default").trace.rows(0, 300), begin(seed=1)
    assert {"q", "qd", "tau", "p_WE"} <= differing(default, other)
    assert differing(default, begin(seed=0)) <= {"synthesis_s"}
    assert not np.array_equal(default.q[0], other.q[0])


def test_a_trace_that_differs_in_one_bit_is_caught():
    trace = run(BOX, "default").trace
    tau = trace.tau.copy()
    tau[7, 3] = np.nextafter(tau[7, 3], np.inf)
    assert differing(trace, replace(trace, tau=tau)) == {"tau"}
