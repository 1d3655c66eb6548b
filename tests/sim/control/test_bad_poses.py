"""No exception leaves the control loop because of what the tracking of the object says."""

import numpy as np
import pytest

from fulcrum.sim.control.controller import ForceController
from fulcrum.sim.evaluation.report import Verdict
from fulcrum.sim.run.execute import Request, execute
from tests.helpers.short_run import short_tilt

BAD = {
    "rounded to 6 decimals": lambda rng, p, q: (p, np.round(q, 6)),
    "rounded to 3 decimals": lambda rng, p, q: (p, np.round(q, 3)),
    "of another length": lambda rng, p, q: (p, 1.3 * q),
    "of the other sign": lambda rng, p, q: (p, -q),
    "zero": lambda rng, p, q: (p, 0.0 * q),
    "tiny": lambda rng, p, q: (p, 1e-160 * q),
    "huge": lambda rng, p, q: (p, 1e160 * q),
    "no number": lambda rng, p, q: (p, np.nan * q),
    "infinite": lambda rng, p, q: (p + np.inf, q),
    "noise": lambda rng, p, q: (rng.normal(size=3), rng.normal(size=4)),
    "far off": lambda rng, p, q: (p + 99.0, q),
}


def spoilt(monkeypatch, change, from_s, until_s):
    """Lets the controller see, for a while, a changed pose."""
    command, rng = ForceController.command, np.random.default_rng(0)

    def seeing(self, measurement):
        if from_s <= measurement.t < until_s:
            p_WO, quat_WO = change(rng, measurement.p_WO, measurement.quat_WO)
            measurement = measurement._replace(p_WO=p_WO, quat_WO=quat_WO)
        return command(self, measurement)

    monkeypatch.setattr(ForceController, "command", seeing)


@pytest.mark.parametrize("controller", ["margin", "robust"])
@pytest.mark.parametrize("bad", BAD)
def test_no_exception_leaves_the_loop_whatever_pose_is_measured(monkeypatch, bad, controller):
    spoilt(monkeypatch, BAD[bad], 0.3, 1.2)
    # How the run ends is the guard's affair; that it ends by its rules is asked here.
    execute(Request(short_tilt(10.0, 0.8), controller))


@pytest.mark.parametrize("controller", ["margin", "robust"])
def test_a_rounded_orientation_does_not_change_the_verdict(monkeypatch, controller):
    spoilt(monkeypatch, BAD["rounded to 6 decimals"], 0.0, np.inf)
    assert execute(Request(short_tilt(10.0, 2.0), controller)).report.verdict is Verdict.PASS
