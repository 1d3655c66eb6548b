"""Interface between the loop and the plant, independent of the engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from fulcrum.sim.signals import AppliedForce, Measurement, Trace
from fulcrum.synthesis import FulcrumError
from fulcrum.synthesis.arrays import Array


class DivergedError(FulcrumError):
    """The simulation's state has diverged to non-finite or excessive numbers."""

    def __init__(self, t: float) -> None:
        super().__init__(f"the simulation diverged at {t:.3f} s; check the scenario's physics.")


class Plant(Protocol):
    """The true robots, object and contacts, simulated one physics step at a time.

    Sensors, motors, pushes and their faults are not part of it. They belong to the world
    (:mod:`sim.world`), which applies to every engine in the same way.

    Attributes:
        joints: Names of the l driven joints, in the order of the motors.
    """

    joints: tuple[str, ...]

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Time of the first contact [s] of each unwanted pair of geoms."""

    def reset(self, q: Array) -> None:
        """Put the robots at rest at joint angles q [rad or m], (l,), and the object at its start.

        Raises:
            DivergedError: The state has diverged.
        """

    def measure(self) -> Measurement:
        """Return the present state, without noise."""

    def apply(self, tau: Array, forces: Sequence[AppliedForce] = ()) -> None:
        """Set torques [N·m or N], (l,), cut at their limits, and forces on the object of a step."""

    def step(self) -> None:
        """Make one physics step, and log it.

        Raises:
            DivergedError: The state has diverged.
        """

    def contacts(self, block: Trace) -> None:
        """Write contacts and motion of hands and object of the logged steps, and forget the steps.

        Args:
            block: Rows of the trace, one per step since the last call, with p_WO and quat_WO filled
                in. Written are p_WE, quat_WE, twist_WE, twist_WO, p_WC (NaN where nothing touches),
                f_W and collisions: the state before each step, and the forces during it.
        """
