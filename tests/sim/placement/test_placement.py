"""Placements: what may move, what a placement is worth, and that a search finds a better one."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.analysis.capacity import capacities
from fulcrum.sim.geometry.pose import Pose
from fulcrum.sim.placement.freedom import Freedom, Moves, with_posture
from fulcrum.sim.placement.mirror import find_mirror
from fulcrum.sim.placement.search import Effort, _Sampler, search
from fulcrum.sim.placement.value import COARSE, FULL, Goal, assess, settled, touching
from fulcrum.sim.scenario.control import controllers
from fulcrum.synthesis import InvalidInputError
from tests.helpers.short_run import short_tilt

BOX = scenario("box-tilt")
# Cheap to look at, and simulated in 1.3 s.
SCENE = short_tilt(3.0, 0.6)
STILL = {
    "x": (0.0, 0.0),
    "y": (0.0, 0.0),
    "yaw_deg": (0.0, 0.0),
    "faces": {},
    "turn_deg": (0.0, 0.0),
    "posture_deg": (0.0, 0.0),
}


def standing(scene, x=0.0, y=0.0, z=0.0):
    """The scene with its robots elsewhere."""
    robots = tuple(replace(r, base=Pose((x, y, z), r.base.quaternion)) for r in scene.robots)
    return replace(scene, robots=robots)


def held(scene, **changes):
    """The scene with its first hand changed."""
    return replace(scene, hands=(replace(scene.hands[0], **changes), *scene.hands[1:]))


def worth(scene, goal=Goal.HEAVIEST, **options):
    return assess(scene, scene.control, goal, **options)


# --- what may move ---


def test_a_freedom_begins_where_the_scenario_stands():
    moves = Moves(SCENE, Freedom())
    placed = moves.scenario(moves.start)
    for found, hand in zip(placed.hands, SCENE.hands, strict=True):
        # Coordinates on a face have four digits.
        assert np.allclose(found.p_OC_O, hand.p_OC_O, rtol=0.0, atol=1e-4)
        assert np.allclose(found.normal_O, hand.normal_O)
        assert np.allclose(found.tangent_O, hand.tangent_O)
    # Start angles are numbers of degrees with two digits: 0.005 deg is 9e-5 rad.
    for joint, angle in SCENE.posture.items():
        assert placed.posture[joint] == pytest.approx(angle, abs=1e-4)
    assert placed.robots[0].base == SCENE.robots[0].base


def test_mirrored_hands_stay_mirrored_and_on_their_faces():
    mirror, moves = find_mirror(SCENE), Moves(SCENE, Freedom())
    assert not {"base y", "base yaw"} & set(moves.names)
    assert not any("right" in name for name in moves.names)
    rng = np.random.default_rng(3)
    for x in rng.random((20, len(moves.names))):
        placed = moves.scenario(x)
        left, right = placed.hands
        assert np.allclose(mirror.point(left.p_OC_O), right.p_OC_O)
        assert np.allclose(mirror.direction(left.normal_O), right.normal_O)
        assert np.allclose(mirror.direction(left.tangent_O), right.tangent_O)
        for hand in placed.hands:
            place = SCENE.object.shape.closest(hand.p_OC_O)
            assert np.allclose(place.point, hand.p_OC_O)
            assert np.allclose(place.normal, hand.normal_O)
        # 20 mm from the ends of a face of 0.3 x 0.1 m.
        assert (np.abs(left.p_OC_O) <= np.array([0.13, 0.1, 0.03]) + 1e-4).all()
        posture = placed.posture
        assert posture["right_e0"] == -posture["left_e0"]
        assert posture["right_e1"] == posture["left_e1"]


def test_without_a_mirror_both_hands_and_the_base_move_on_their_own():
    skewed = held(SCENE, p_OC_O=(0.06, 0.1, 0.0))
    assert find_mirror(skewed) is None
    moves = Moves(skewed, Freedom())
    assert {"base x", "base y", "base yaw", "left u", "right u", "right turn"} <= set(moves.names)
    x = moves.start.copy()
    x[moves.names.index("base yaw")] = 1.0
    base = moves.scenario(x).robots[0].base
    # 60 deg about the vertical through the edge, 0.5 m in front.
    expected = (0.5 - 0.5 * np.cos(np.pi / 3), -0.5 * np.sin(np.pi / 3), 0.0)
    assert np.allclose(base.position, expected)
    assert np.allclose(base.quaternion, (np.cos(np.pi / 6), 0.0, 0.0, np.sin(np.pi / 6)))


def test_a_hand_may_go_to_another_face_if_it_is_allowed():
    freedom = Freedom(**{**STILL, "faces": {"left": ("+z",), "right": ()}})
    skewed = held(SCENE, p_OC_O=(0.06, 0.1, 0.0))
    moves = Moves(skewed, freedom)
    x = moves.start.copy()
    x[moves.names.index("left face")] = 0.9
    hand = moves.scenario(x).hands[0]
    assert hand.p_OC_O[2] == pytest.approx(0.05)
    assert hand.normal_O == pytest.approx((0.0, 0.0, -1.0))
    assert abs(np.dot(hand.tangent_O, hand.normal_O)) < 1e-9


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (STILL, "something that may move"),
        ({"x": (0.1, 0.2)}, "freedom.x: got .* contains 0"),
        ({"turn_deg": (float("nan"), 0.0)}, "freedom.turn_deg"),
        ({"border": -0.01}, "freedom.border"),
        ({"faces": {"middle": ()}}, "one of left, right"),
        ({"faces": {"left": ("top",)}}, r"one of \+x, -x"),
    ],
)
def test_a_senseless_freedom_is_refused(changes, said):
    with pytest.raises(InvalidInputError, match=said):
        Moves(SCENE, Freedom(**changes))


def test_a_contact_off_the_surface_is_refused_with_the_nearest_point():
    with pytest.raises(InvalidInputError, match=r"nearest one, \(0.075, 0.1, 0\), 20 mm off"):
        Moves(held(SCENE, p_OC_O=(0.075, 0.12, 0.0)), Freedom())


# --- what a placement is worth ---


def test_coarse_and_full_look_agree_with_the_capacity_command():
    full, coarse = worth(BOX), worth(BOX, steps=COARSE)
    # Both find the tightest tilt, 0 deg; 1e-6 is a thousand solver tolerances.
    assert full.heaviest == pytest.approx(capacities(BOX, BOX.control)[0].weight, rel=1e-6)
    assert coarse.heaviest == pytest.approx(full.heaviest, rel=1e-6)
    assert 0.0 < full.friction < BOX.control.friction_factor
    assert 0.0 < full.torque < 1.0


def test_worse_placements_cost_more_and_say_why():
    heavy = replace(SCENE, object=SCENE.object.weighing(10.0))
    within = standing(SCENE, x=0.45)  # the chest, in the object
    values = [worth(s) for s in (SCENE, heavy, standing(SCENE, x=-0.8), within)]
    assert [v.feasible for v in values] == [True, False, False, False]
    costs = [v.cost for v in values]
    assert costs == sorted(costs)
    assert "0 deg" in values[1].reason
    assert "cannot follow" in values[2].reason
    assert "within 5 mm" in values[3].reason


def test_being_farther_away_costs_more_even_out_of_reach():
    costs = [worth(standing(SCENE, x=x)).cost for x in (-0.6, -0.8, -1.0)]
    assert costs[0] < costs[1] < costs[2]


def test_a_start_posture_whose_arms_overlap_is_not_let_through():
    # Such pairs are left out of the arms' collision avoidance.
    crossed = with_posture(SCENE, {"left_s0": -1.5, "right_s0": 1.5, "left_s1": 0.0})
    value = worth(crossed)
    assert not value.feasible
    assert "left" in value.reason and "right" in value.reason
    assert worth(crossed, tolerated=touching(crossed)).cost < value.cost


def test_a_settled_start_posture_changes_nothing():
    value, own = worth(settled(SCENE)), worth(SCENE)
    # The angles are rounded to 0.01 deg, and the arms settle from there.
    assert value.heaviest == pytest.approx(own.heaviest, rel=1e-3)


# --- the search ---


def bowl(batch):
    return [float(np.square(x - 0.3).sum()) for x in batch]


def sampled(seed, evaluations=160, numbers=3):
    effort = Effort(evaluations, seed=seed, workers=1)
    sampler = _Sampler(np.full(numbers, 0.9), effort, deadline=np.inf)
    sampler.run(bowl, lambda done, total, note: None)
    return sampler


def test_the_same_seed_gives_the_same_search():
    first, again, other = sampled(1), sampled(1), sampled(2)
    assert first.history == again.history
    assert np.array_equal(first.best(), again.best())
    assert first.history != other.history


@pytest.mark.parametrize("numbers", [1, 2, 3])
def test_the_sampler_finds_the_bottom_of_a_bowl(numbers):
    best = sampled(0, 320, numbers).best()[0]
    assert best.shape == (numbers,)
    # A hundredth of every range; the start is 0.6 off.
    assert best == pytest.approx(0.3, abs=0.01)


def test_a_search_whose_time_is_up_looks_at_no_more_than_the_first_sample():
    sampler = _Sampler(np.full(3, 0.9), Effort(160, 60.0, 0, workers=1), deadline=-np.inf)
    sampler.run(bowl, lambda done, total, note: None)
    # One sample of 32; with time left there are five.
    assert (sampler.done, sampler.in_time) == (32, False)
    assert (sampled(0).done, sampled(0).in_time) == (160, True)


# That a search improves, and what confirms it, is in tests/scenarios/test_place.py.
def test_a_claim_that_is_not_so_would_be_caught():
    value = worth(SCENE)
    elsewhere = standing(SCENE, x=0.03)
    assert value.heaviest != pytest.approx(
        capacities(elsewhere, elsewhere.control)[0].weight, rel=1e-3
    )


def test_an_unknown_controller_or_effort_is_refused():
    with pytest.raises(InvalidInputError, match=r"one of robust"):
        search(SCENE, "best")
    with pytest.raises(InvalidInputError, match=r"effort\.workers"):
        Effort(workers=0)
    with pytest.raises(InvalidInputError, match=r"effort\.evaluations"):
        Effort(evaluations=7)


def test_a_robust_controller_counts_with_the_worst_of_its_set():
    robust = controllers(SCENE.control)["robust"]
    value = assess(SCENE, robust, Goal.LOWEST_TORQUE, FULL)
    # It presses with 52 N instead of 5 N at least.
    assert value.torque > worth(SCENE).torque
