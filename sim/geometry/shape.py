"""Base class of shapes: faces, volume, inertia, geoms, and places for contacts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple, TypeAlias

import numpy as np

from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.pose import Quaternion, triple
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector
from fulcrum.synthesis.checks import vector
from fulcrum.synthesis.settings import Settings

Color: TypeAlias = tuple[float, float, float, float]

COLOR: Color = (0.80, 0.62, 0.40, 0.5)
UNTURNED: Quaternion = (1.0, 0.0, 0.0, 0.0)
AXES = "xyz"


class Place(NamedTuple):
    """A point of a surface.

    Attributes:
        point: The point in the object frame [m].
        normal: Inward normal in the object's axes.
        face: Name of the face.
    """

    point: Vector
    normal: Vector
    face: str


class Shape(Settings, ABC):
    """A shape in the object's frame; the origin is its middle (for a mesh: that of its file).

    Its faces have names; a place on a face is given by two coordinates u and v in [0, 1].
    """

    @property
    def label(self) -> str:
        """Name of the shape in error messages."""
        return "shape"

    @property
    @abstractmethod
    def faces(self) -> tuple[str, ...]:
        """Names of the faces."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume [m^3]."""

    @property
    def center(self) -> Vector:
        """Centre of mass in the object frame for uniform density [m]."""
        return (0.0, 0.0, 0.0)

    @property
    def principal_axes(self) -> Quaternion:
        """Orientation of the principal axes in the object frame, wxyz."""
        return UNTURNED

    @abstractmethod
    def inertia(self, mass: float) -> Vector:
        """Return the principal moments [kg m^2] about the centre of mass for uniform density."""

    @abstractmethod
    def geoms(self, name: str, rgba: Color = COLOR) -> tuple[Geom, ...]:
        """Return the geoms of the shape; a single geom has the given name."""

    def touched(self, name: str, p_O: Vector) -> str:
        """Return the name of the geom of :meth:`geoms` that a hand at p_O [m] touches."""
        return name

    @property
    def resting(self) -> str | None:
        """Name of the geom that touches the environment; None if it is the one that hands touch."""
        return None

    @abstractmethod
    def scaled(self, factor: float) -> Shape:
        """Return a copy with all lengths multiplied by `factor`."""

    def closest(self, p_O: Vector) -> Place:
        """Return the surface point closest to a point p_O in the object frame [m]."""
        vector("p_O", p_O, 3)
        return self._closest(np.array(p_O, float))

    def place(self, face: str, u: float, v: float) -> Place:
        """Return the point of a face at coordinates u and v in [0, 1].

        Raises:
            InvalidInputError: There is no such face, or a coordinate is outside.
        """
        if face not in self.faces:
            raise InvalidInputError("face", face, f"one of {', '.join(self.faces)}")
        for name, share in (("u", u), ("v", v)):
            if not 0.0 <= share <= 1.0:
                raise InvalidInputError(f"face {face}: {name}", share, "in [0, 1]")
        return self._place(face, u, v)

    @abstractmethod
    def _closest(self, p_O: Array) -> Place: ...

    @abstractmethod
    def _place(self, face: str, u: float, v: float) -> Place: ...


def cyclic(axis: str, along: float, first: float, second: float) -> Vector:
    """Return the vector with these components along an axis and the two that follow it."""
    return triple(np.roll([along, first, second], AXES.index(axis)))
