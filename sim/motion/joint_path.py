"""Joint angles of the arms along the object's path, as a table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from fulcrum.sim.motion.schedule import Schedule
from fulcrum.synthesis import FulcrumError, InvalidInputError
from fulcrum.synthesis.arrays import Array


@dataclass(frozen=True)
class JointGrid:
    """Steps of a joint path.

    The defaults are fine enough: a cubic spline through the steps places the hands to within 1 um.

    Attributes:
        tilt_deg: Largest step of the tilt [deg].
        gap_m: Largest step of the hands' distance from their contacts [m].
        least: Smallest number of steps of a phase.
        clearance_m: Least distance of links from each other and from the scene at the steps [m].
    """

    tilt_deg: float = 1.0
    gap_m: float = 0.005
    least: int = 4
    clearance_m: float = 0.005


class PathError(FulcrumError):
    """The arms cannot follow the object's path; names the tilt and the limits that stop them.

    Attributes:
        tilt_deg: Tilt at which the arms stop [deg].
        error: Pose error of the hands there [m and rad].
        share: Share of the manoeuvre's steps that were solved before, in planning order [-].
        reasons: Limits that stop the arms.
    """

    def __init__(
        self, tilt: float, gap: float, error: float, reasons: list[str], share: float = 0.0
    ) -> None:
        self.tilt_deg = float(np.degrees(tilt))
        self.error, self.share, self.reasons = error, share, reasons
        super().__init__(
            f"inverse kinematics cannot follow the path at a tilt of {self.tilt_deg:.1f} deg with "
            f"the hands {1e3 * gap:.0f} mm off their contacts (pose error {error:.2g} m/rad): "
            f"{'; '.join(reasons)}."
        )


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint angles as functions of each phase's progress.

    Attributes:
        schedule: The phases.
        progress: Grid of progresses of each phase [-], (k,).
        q: Joint angles of each phase at its grid [rad or m], (k, l), in the order of the motors.
        clearance: Smallest distance to a joint limit over the manoeuvre [rad or m], (l,).
    """

    schedule: Schedule
    progress: tuple[Array, ...]
    q: tuple[Array, ...]
    clearance: Array

    @cached_property
    def _splines(self) -> tuple[CubicSpline, ...]:
        return tuple(CubicSpline(x, q) for x, q in zip(self.progress, self.q, strict=True))

    @property
    def start(self) -> Array:
        """Joint angles at the start of the manoeuvre [rad or m], (l,)."""
        return self.q[0][0]

    def at(self, phase: int, progress: Array | float) -> tuple[Array, Array]:
        """Return angles and their derivatives, (..., l) each, at progresses, (...), of a phase."""
        spline = self._splines[phase]
        return spline(progress), spline(progress, 1)

    def curvature(self, phase: int, progress: Array | float) -> Array:
        """Return the second derivatives of the angles by a phase's progress, (..., l)."""
        return self._splines[phase](progress, 2)

    def holding(self, tilt: float) -> Array:
        """Return the angles [rad or m], (l,), that hold the object at a tilt [rad].

        Raises:
            InvalidInputError: The manoeuvre does not pass through that tilt.
        """
        end = self.schedule.end
        for index, phase in enumerate(self.schedule.phases):
            low, high = self.schedule.before(index).tilt, phase.tilt
            if phase.grip > 0.0 and low < high and low <= tilt / end <= high:
                return self.at(index, (tilt / end - low) / (high - low))[0]
        given = f"{np.degrees(tilt):g} deg"
        raise InvalidInputError("tilt", given, f"between 0 and {np.degrees(end):g} deg")
