"""Presets draw the stiffness of each hand's contact."""

from dataclasses import replace

import numpy as np
import pytest

from fulcrum.scenarios import scenario
from fulcrum.sim.world.presets import draw, preset
from fulcrum.sim.world.world import World
from fulcrum.synthesis import InvalidInputError

BOX = scenario("box-tilt")
RANGES = {"lab": (0.7, 1.4), "field": (0.5, 2.0), "harsh": (0.25, 4.0)}


@pytest.mark.parametrize("name", RANGES)
def test_each_hand_draws_its_own_stiffness_log_uniformly(name):
    low, high = RANGES[name]
    drawn = np.array([draw(preset(name), BOX, seed).stiffness for seed in range(60)])
    assert drawn.shape == (60, 2)
    assert low < drawn.min() < 1.1 * low
    assert high / 1.1 < drawn.max() < high
    assert (drawn[:, 0] != drawn[:, 1]).all()
    # Of a log-uniform draw the median is the geometric mean; 120 draws give it to 5 % of the range.
    share = (np.median(np.log(drawn)) - np.log(low)) / np.log(high / low)
    assert share == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("name", RANGES)
def test_worlds_are_otherwise_those_without_the_draw(name):
    ranges = preset(name)
    without = replace(ranges, stiffness_down=0.0, stiffness_up=0.0)
    for seed in range(3):
        world = draw(ranges, BOX, seed)
        assert world != draw(without, BOX, seed)
        assert replace(world, stiffness=(1.0, 1.0)) == draw(without, BOX, seed)


def test_a_hand_s_factor_reaches_the_truth_and_no_other_contact():
    truth = World(stiffness=(0.5, 2.0)).truth(BOX)
    stated = BOX.hands[0].material
    assert [hand.material for hand in truth.hands] == [stated.scaled(0.5), stated.scaled(2.0)]
    assert truth.supports == BOX.supports


def test_factors_that_do_not_fit_are_refused():
    with pytest.raises(InvalidInputError, match=r"^world\.stiffness"):
        World(stiffness=(1.0,)).truth(BOX)
    with pytest.raises(InvalidInputError, match=r"^world\.stiffness"):
        World(stiffness=(1.0, 0.0))
