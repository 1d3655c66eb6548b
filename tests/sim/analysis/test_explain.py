"""`fulcrum explain` and `fulcrum capacity`: the words name what really conflicts."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fulcrum.scenarios.cli import main
from fulcrum.scenarios.reading import library
from fulcrum.sim.analysis.capacity import capacities
from fulcrum.sim.analysis.explain import explain, tightest_tilt
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.run.trial import confirm
from fulcrum.sim.scenario.control import controllers
from fulcrum.synthesis import InfeasibleError, InvalidInputError, Synthesizer
from fulcrum.synthesis.analysis.conflict import BALANCES, conflict, rebased, tightest
from fulcrum.synthesis.analysis.relaxation import ChangeOutcome, Kind, changes, weight_range
from fulcrum.synthesis.problem import Gravity
from tests.helpers.problems import cylinder

SYNTHESIZER = Synthesizer()
BOX_TILT = library.scenario("box-tilt")
BOX_LIFT = replace(BOX_TILT, name="box-lift", supports=())


@cache
def problems(name="box-lift", controller="margin"):
    scene = {"box-lift": BOX_LIFT, "box-tilt": BOX_TILT}[name]
    return PathProblems(scene, controllers(scene.control)[controller])


@cache
def explained(tilt_deg, name="box-lift", controller="margin"):
    return explain(problems(name, controller), tilt_deg, SYNTHESIZER)


def is_feasible(problem):
    try:
        SYNTHESIZER.solve(problem)
    except InfeasibleError:
        return False
    return True


def heaviest(problem, tilt_deg):
    return weight_range(problem, problems().gravity(tilt_deg), SYNTHESIZER)[1]


def with_limits_of(problem, joints, factor):
    """The problem with the torque limits of some joints changed."""
    chosen = np.array([factor if name in joints else 1.0 for name in problem.joints.names])
    tau_min, tau_max = problem.joints.tau_min * chosen, problem.joints.tau_max * chosen
    return replace(problem, joints=replace(problem.joints, tau_min=tau_min, tau_max=tau_max))


def with_friction_of(problem, names, factor):
    contacts = tuple(
        replace(c, mu=factor * c.mu) if c.name in names else c for c in problem.contacts
    )
    return replace(problem, contacts=contacts)


# --- whether, and why not ---


@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("controller", ["margin", "paper"])
def test_baxter_cannot_lift_the_box_in_its_pose(tilt, controller):
    assert not explained(tilt, controller=controller).feasible


def test_baxter_can_hold_the_box_upright():
    assert explained(90.0).feasible


def test_baxter_can_pivot_the_box():
    assert explained(0.0, "box-tilt").feasible


@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0])
def test_shares_add_up_to_one_heaviest_first(tilt):
    found = explained(tilt).conflict
    for shares in (found.balances, found.limits, found.asked):
        assert sum(shares.values()) == pytest.approx(1.0, abs=1e-12)
        assert list(shares.values()) == sorted(shares.values(), reverse=True)
    # Terms under 1e-4 are left out of it.
    assert sum(found.given.values()) == pytest.approx(found.bearable, abs=1e-3)


@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0])
def test_lift_fails_of_vertical_force_within_hand_friction_and_shoulder_torque(tilt):
    found = explained(tilt).conflict
    # The object's own axes are turned by the tilt; the world's vertical is what counts.
    assert next(iter(found.balances)) == "force balance along world z"
    assert set(found.limits) == {
        "friction of left",
        "friction of right",
        "torque limit of left_s0",
        "torque limit of right_s0",
    }
    for name in (*found.balances, *found.limits):
        assert name in found.sentence


@pytest.mark.parametrize("tilt", [0.0, 30.0, 60.0])
def test_what_can_be_borne_is_the_weight_that_could_be_lifted(tilt):
    found = explained(tilt)
    # The proof comes from 1e-6 beyond the border.
    assert found.conflict.bearable == pytest.approx(found.changes[Kind.WEIGHT].factor, abs=1e-4)


def test_constraints_without_a_share_are_not_needed():
    found, problem = explained(30.0), problems().problem(30.0)
    without = [
        n for n in problem.joints.names if f"torque limit of {n}" not in found.conflict.limits
    ]
    assert len(without) == 12
    assert not is_feasible(with_limits_of(problem, without, np.inf))


@pytest.mark.parametrize("hand", ["left", "right"])
def test_relaxing_the_friction_of_a_hand_helps(hand):
    problem = problems().problem(30.0)
    before = heaviest(problem, 30.0)
    gain = heaviest(with_friction_of(problem, [hand], 1.1), 30.0) / before - 1.0
    # One hand that lifts more rolls the box: only the torsion at the hands takes that up.
    assert 0.005 < gain < 0.05
    assert explained(30.0).gains[f"friction of {hand}"] == pytest.approx(gain, rel=1e-6)
    both = heaviest(with_friction_of(problem, ["left", "right"], 1.1), 30.0)
    assert both == pytest.approx(1.1 * before, rel=1e-3)


def test_relaxing_both_shoulders_helps_and_one_alone_does_not():
    problem = problems().problem(30.0)
    before = heaviest(problem, 30.0)
    both = heaviest(with_limits_of(problem, ["left_s0", "right_s0"], 1.1), 30.0)
    assert both == pytest.approx(1.1 * before, rel=1e-3)
    # The hands squeeze: the grip of one is the grip of the other. The rest is solver tolerance.
    for joint in ("left_s0", "right_s0"):
        assert explained(30.0).gains[f"torque limit of {joint}"] == pytest.approx(0.0, abs=1e-6)


def test_relaxing_a_constraint_without_a_share_does_not_help():
    problem = problems().problem(30.0)
    # The solver's tolerance.
    assert heaviest(with_limits_of(problem, ["left_s1"], 2.0), 30.0) == pytest.approx(
        heaviest(problem, 30.0), rel=1e-6
    )


@pytest.mark.parametrize("turn_deg", [0.0, 40.0])
def test_cylinder_s_conflict_is_in_world_axes_and_about_the_centre_of_mass(turn_deg):
    """The same problem in an object frame that is turned and shifted gives the same words."""
    problem = cylinder(0.0, environment=False)
    R, shift = Rotation.from_rotvec([0.3, np.radians(turn_deg), 0.1]).as_matrix(), np.ones(3)
    center = shift
    weight_O = R @ problem.w_ext_O[:3]
    moved = replace(
        problem,
        R_OC=R @ problem.R_OC,
        p_OC_O=problem.p_OC_O @ R.T + shift,
        w_ext_O=np.concatenate([weight_O, np.cross(center, weight_O)]),
    )
    words = []
    for p, R_WO, c in ((problem, np.eye(3), np.zeros(3)), (moved, R.T, center)):
        weight = float(np.linalg.norm(p.w_ext_O[:3]))
        gravity = Gravity(weight, p.w_ext_O[:3] / weight, c)
        with pytest.raises(InfeasibleError) as error:
            SYNTHESIZER.solve(p)
        found = changes(p, gravity, SYNTHESIZER)
        words.append(conflict(tightest(error.value.certificate, found), gravity, R_WO))
    first, second = words
    # Two solves of one problem in different frames, with 1697 N where 30 N weigh.
    assert first.balances == pytest.approx(second.balances, abs=1e-3)
    # One frame's noise may be named, from a share of 1e-4 on (measured 1.6e-4), the other's not.
    for name in {*first.limits, *second.limits}:
        assert first.limits.get(name, 0.0) == pytest.approx(second.limits.get(name, 0.0), abs=1e-3)
    assert first.bearable == pytest.approx(second.bearable, rel=1e-4)
    assert "moment balance about world y" in first.balances
    assert {"grip limit of outer", "grip limit of inner"} & set(first.limits)


def test_proof_from_the_border_proves_nothing_about_a_feasible_problem():
    border = changes(problems().problem(0.0), problems().gravity(0.0), SYNTHESIZER)[Kind.WEIGHT]
    light = replace(border.conflict.problem, w_ext_O=0.9 * border.conflict.problem.w_ext_O)
    assert border.conflict.proves(1e3)
    assert not rebased(border.conflict, light).proves(1e3)


# --- what would help, how much is borne ---


def test_changes_that_would_let_baxter_lift_the_box():
    found = explained(0.0).changes
    weight = found[Kind.WEIGHT]
    # Shoulder yaw has no gravity to bear, and holds the grip alone: all are one proportion.
    for kind in (Kind.FRICTION, Kind.TORQUE):
        assert found[kind].factor * weight.factor == pytest.approx(1.0, rel=1e-4)
    assert weight.text == "to at most 0.5985 times (11.97 N)"
    assert found[Kind.FRICTION].text == "to at least 1.671 times (0.1671 at left and right)"
    assert found[Kind.GRIP].text == "there are no grip limits"
    assert all(r.confirmed_within <= 1e-5 for r in found.values())


def test_margins_of_the_pivot():
    found = explained(0.0, "box-tilt")
    optimum = found.optimum
    assert set(optimum.active) == {"friction of left", "friction of right"}
    # Grip is proportional to the weight, and inversely to the friction of both hands together.
    influence = {name: i.per_percent for name, i in optimum.influences.items()}
    expected = {"weight": 1.0, "friction of left": -0.5, "friction of right": -0.5}
    assert influence == pytest.approx(expected, abs=1e-6)
    assert found.changes[Kind.WEIGHT].factor == pytest.approx(2.218, abs=1e-3)
    assert found.changes[Kind.TORQUE].factor == pytest.approx(0.619, abs=1e-3)


def test_no_friction_to_speak_of_is_needed_where_the_box_balances():
    friction = explained(71.565, "box-tilt").changes[Kind.FRICTION]
    assert friction.outcome is ChangeOutcome.ALWAYS


def test_scan_finds_the_first_infeasible_or_else_the_tightest_tilt():
    assert tightest_tilt(problems("box-lift"), SYNTHESIZER) == 0.0
    assert tightest_tilt(problems("box-tilt"), SYNTHESIZER) == 0.0


@pytest.mark.parametrize("tilt", [-1.0, 90.1, float("nan")])
def test_tilt_off_the_path_is_named(tilt):
    with pytest.raises(InvalidInputError, match="from 0 to 90 deg"):
        problems().problem(tilt)


def test_balances_are_named_in_the_order_of_a_wrench():
    assert [name[-1] for name in BALANCES] == list("xyzxyz")


# --- capacity ---


@cache
def found_capacities(controller="margin"):
    return capacities(BOX_TILT, controllers(BOX_TILT.control)[controller])


def test_baxter_pivots_four_times_what_it_lifts():
    pivot, lift = found_capacities("paper")
    assert (pivot.manoeuvre, lift.manoeuvre) == ("pivot", "lift")
    assert pivot.weight == pytest.approx(55.4, abs=0.1)
    assert lift.weight == pytest.approx(15.0, abs=0.1)
    assert pivot.confirmed_within == lift.confirmed_within == 1e-6
    assert "torque limit of left_s0" in pivot.conflict.limits


def test_capacity_is_the_least_of_all_tilts():
    for capacity in found_capacities():
        assert capacity.weight == pytest.approx(min(capacity.weights), rel=1e-9)
        assert capacity.tilt_deg == 0.0


@pytest.mark.parametrize(("share", "verdict"), [(0.95, "pass"), (1.05, "fail")])
def test_closed_loop_bears_the_capacity_out(share, verdict):
    pivot = found_capacities()[0]
    trial = confirm(BOX_TILT, "margin", BOX_TILT.control, pivot.weight, share)
    assert trial.verdict == verdict
    assert trial.weight == pytest.approx(share * pivot.weight)
    assert (trial.failed_syntheses == 0) is (share < 1.0)


# --- the command line ---


@pytest.fixture
def box_lift(monkeypatch):
    known = {**library.scenarios(), "box-lift": BOX_LIFT}
    monkeypatch.setattr(library, "scenarios", lambda: known)


def no_constant(name):
    raise AssertionError(f"{name} in JSON")


@pytest.mark.parametrize(("name", "code"), [("box-tilt", 0), ("box-lift", 1)])
def test_explain_prints_writes_json_and_says_by_its_code_whether_it_is_feasible(
    name, code, box_lift, tmp_path, capsys
):
    file = tmp_path / "why.json"
    assert main(["explain", name, "--json", str(file)]) == code
    content = json.loads(file.read_text(), parse_constant=no_constant)
    assert content["feasible"] is (code == 0)
    assert (content["conflict"] is None) is (code == 0)
    assert set(content["changes"]) == set(Kind)
    out = capsys.readouterr().out
    assert ("INFEASIBLE" in out) is (code == 1)


@pytest.mark.parametrize(
    "arguments",
    [
        ["explain", "box-tilt", "--tilt-deg", "95"],
        ["explain", "no-such"],
        ["explain", "box-tilt", "--objective", "no-such"],
        ["explain", "box-tilt", "--controller", "no-such"],
        ["capacity", "box-tilt", "--json", "/no/such/folder/file.json"],
    ],
)
def test_bad_input_is_one_sentence_and_code_2(arguments, capsys):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert not out
    assert err.count("\n") == 1 and "valid is" in err


def test_capacity_command_writes_json(tmp_path, capsys):
    file = tmp_path / "capacity.json"
    assert main(["capacity", "box-tilt", "--json", str(file)]) == 0
    content = json.loads(file.read_text(), parse_constant=no_constant)
    assert [c["manoeuvre"] for c in content["capacities"]] == ["pivot", "lift"]
    assert content["trials"] == []
    assert "44.36 N" in capsys.readouterr().out
