"""Setpoints arrive after the world's latency, in order, and as often as it says not at all."""

import numpy as np
import pytest

from fulcrum.sim.signals.setpoint import Setpoint
from fulcrum.sim.world.channel import Channel
from fulcrum.sim.world.world import World

TICK_S = 0.004


def setpoint(number):
    return Setpoint(np.array([float(number)]), np.zeros((1, 6)), np.zeros((1, 1)))


def test_without_latency_a_setpoint_arrives_at_once_and_once():
    channel = Channel(World())
    channel.send(0.0, setpoint(1))
    assert channel.receive(0.0).tau_f == 1.0
    assert channel.receive(0.0) is None


@pytest.mark.parametrize("latency_s", [0.001, 0.004, 0.010])
def test_setpoints_arrive_after_the_latency_and_not_before(latency_s):
    channel, t, arrived = Channel(World(latency=latency_s)), 0.0, {}
    for step in range(200):  # the clock adds up its steps, with their rounding
        if step % 4 == 0:
            channel.send(t, setpoint(step))
        received = channel.receive(t)
        if received is not None:
            arrived[step] = int(received.tau_f[0])
        t += 0.001
    delays = {step - sent for step, sent in arrived.items()}
    assert delays == {round(1e3 * latency_s)}


def test_of_setpoints_that_arrive_together_the_newest_counts():
    channel = Channel(World())
    channel.send(0.0, setpoint(1))
    channel.send(0.001, setpoint(2))
    assert channel.receive(0.002).tau_f == 2.0


def test_as_many_setpoints_get_lost_as_the_world_says():
    channel, arrived, ticks = Channel(World(seed=4, dropped=0.1)), 0, 5000
    for tick in range(ticks):
        channel.send(tick * TICK_S, setpoint(tick))
        arrived += channel.receive(tick * TICK_S) is not None
    # Four standard deviations of a binomial count.
    assert abs(ticks - arrived - 0.1 * ticks) < 4.0 * np.sqrt(ticks * 0.1 * 0.9)
