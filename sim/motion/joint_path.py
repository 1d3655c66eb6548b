"""How the arms follow the object's path, as tabulated joint angles."""

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

    A cubic spline through the steps left out here follows the hands to under a micrometre.

    Attributes:
        tilt_deg: Largest step of the tilt [deg].
        gap_m: Largest step of the hands' distance from their contacts [m].
        least: Steps of a phase, at least.
        clearance_m: That links keep from each other and from the scene at the steps [m].
    """

    tilt_deg: float = 1.0
    gap_m: float = 0.005
    least: int = 4
    clearance_m: float = 0.005


class PathError(FulcrumError):
    """The arms cannot follow the object's path; says at which tilt, and which limit stops.

    Attributes:
        tilt_deg: [deg].
        error: Of the hands' poses where they got stuck [m and rad].
        share: Of the manoeuvre's steps, as they are planned, that were solved before [-].
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
        progress: Grid of progresses of each phase, (k,).
        q: Joint angles [rad or m] of each phase at its grid, (k, l), in the order of the motors.
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
        """Where the manoeuvre starts, (l,)."""
        return self.q[0][0]

    def at(self, phase: int, progress: Array | float) -> tuple[Array, Array]:
        """Angles, (..., l), at progresses, (...), of a phase, and their derivatives by it."""
        spline = self._splines[phase]
        return spline(progress), spline(progress, 1)

    def curvature(self, phase: int, progress: Array | float) -> Array:
        """Second derivatives of the angles by the progress of a phase, (..., l)."""
        return self._splines[phase](progress, 2)

    def holding(self, tilt: float) -> Array:
        """Angles, (l,), that hold the object at a tilt of the path [rad].

        Raises:
            InvalidInputError: The manoeuvre does not come through that tilt.
        """
        end = self.schedule.end
        for index, phase in enumerate(self.schedule.phases):
            low, high = self.schedule.before(index).tilt, phase.tilt
            if phase.grip > 0.0 and low < high and low <= tilt / end <= high:
                return self.at(index, (tilt / end - low) / (high - low))[0]
        given = f"{np.degrees(tilt):g} deg"
        raise InvalidInputError("tilt", given, f"between 0 and {np.degrees(end):g} deg")
