"""What a plant is to the loop, whatever engine simulates it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from fulcrum.sim.signals.force import AppliedForce
from fulcrum.sim.signals.measurement import Measurement
from fulcrum.sim.signals.trace import Trace
from fulcrum.synthesis import FulcrumError
from fulcrum.synthesis.arrays import Array


class DivergedError(FulcrumError):
    """The simulation's state has left what numbers can hold."""

    def __init__(self, t: float) -> None:
        super().__init__(f"the simulation diverged at {t:.3f} s; check the scenario's physics.")


class Plant(Protocol):
    """The truth about robots, object and contacts, one physics step at a time.

    Sensors, motors, pushes and their faults are not part of it: they belong to the world
    (:mod:`sim.world`), which disturbs every engine alike.

    Attributes:
        joints: Names of the l driven joints, in the order of the motors.
    """

    joints: tuple[str, ...]

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Pairs of geoms that touched against the scenario's will, and when first [s]."""

    def reset(self, q: Array) -> None:
        """Put the robots at rest at joint angles q [rad or m], (l,), and the object at its start.

        Raises:
            DivergedError: The state is more than numbers can hold.
        """

    def measure(self) -> Measurement:
        """Return the present state, without noise."""

    def apply(self, tau: Array, forces: Sequence[AppliedForce] = ()) -> None:
        """Set torques [N·m or N], (l,), cut at their limits, and forces on the object of a step."""

    def step(self) -> None:
        """Make one physics step, and log it.

        Raises:
            DivergedError: The state has left what numbers can hold.
        """

    def contacts(self, block: Trace) -> None:
        """Fill in what contacts, hands and object did during the logged steps, and forget those.

        Args:
            block: One row per step since the last call, with p_WO and quat_WO filled in; written
                are p_WE, quat_WE, twist_WE, twist_WO, p_WC (NaN where nothing touches), f_W and
                collisions, as of the state before each step and the forces during it.
        """
