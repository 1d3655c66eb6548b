"""The object that is tilted: mass, inertia and geoms."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Quaternion
from fulcrum.sim.geometry.shape import COLOR, Color, Shape
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector
from fulcrum.synthesis.checks import length, positive, vector

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Object:
    """The object that is tilted.

    Attributes:
        name: Name for messages and pages.
        mass: Mass [kg].
        inertia: Principal moments about the centre of mass [kg m^2].
        center_of_mass: Centre of mass in the object frame [m].
        geoms: Geoms of the object; contacts refer to them by name.
        principal_axes: Orientation of the principal axes in the object frame, wxyz.
        shape: Shape that its geoms stand for, if it is one of :mod:`sim.geometry.shapes`.
    """

    name: str
    mass: float
    inertia: Vector
    geoms: tuple[Geom, ...]
    center_of_mass: Vector = (0.0, 0.0, 0.0)
    principal_axes: Quaternion = (1.0, 0.0, 0.0, 0.0)
    shape: Shape | None = None

    def __post_init__(self) -> None:
        positive(f"{self.name}.mass", self.mass)
        length(f"{self.name}.inertia", self.inertia, 3)
        for moment in self.inertia:
            positive(f"{self.name}.inertia", moment)
        vector(f"{self.name}.center_of_mass", self.center_of_mass, 3)
        vector(f"{self.name}.principal_axes", self.principal_axes, 4)
        if not abs(math.hypot(*self.principal_axes) - 1.0) < 1e-3:  # normalised where it is used
            valid = "a quaternion of length 1"
            raise InvalidInputError(f"{self.name}.principal_axes", self.principal_axes, valid)

    @cached_property
    def inertia_O(self) -> Array:
        """Inertia about the centre of mass in the object's axes [kg m^2], (3, 3)."""
        R_OI = Rotation.from_quat(self.principal_axes, scalar_first=True).as_matrix()
        return R_OI @ np.diag(self.inertia) @ R_OI.T

    def weighing(self, factor: float) -> Object:
        """Return a copy with mass and inertia multiplied by `factor`."""
        x, y, z = self.inertia
        inertia = (factor * x, factor * y, factor * z)
        return replace(self, mass=factor * self.mass, inertia=inertia)


def homogeneous(name: str, shape: Shape, mass: float, rgba: Color = COLOR) -> Object:
    """Return an object of uniform density from a shape and a mass [kg]."""
    positive(f"{name}.mass", mass)
    return Object(
        name=name,
        mass=mass,
        inertia=shape.inertia(mass),
        geoms=shape.geoms(name, rgba),
        center_of_mass=shape.center,
        principal_axes=shape.principal_axes,
        shape=shape,
    )
