"""What a shape is: its faces, volume and inertia, its geoms, and where on it a contact may be."""

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
        point: In the object frame [m].
        normal: Into the object, in its axes.
        face: Name of the face.
    """

    point: Vector
    normal: Vector
    face: str


class Shape(Settings, ABC):
    """A shape in the object's frame, whose origin is its middle (of a mesh: that of its file).

    Its faces have names; a place on a face is said by two coordinates u and v in [0, 1].
    """

    @property
    def label(self) -> str:
        """What errors call the shape."""
        return "shape"

    @property
    @abstractmethod
    def faces(self) -> tuple[str, ...]:
        """Names of the faces."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """[m^3]."""

    @property
    def center(self) -> Vector:
        """Centre of mass, if homogeneous, in the object frame [m]."""
        return (0.0, 0.0, 0.0)

    @property
    def principal_axes(self) -> Quaternion:
        """Orientation of the principal axes in the object frame, wxyz."""
        return UNTURNED

    @abstractmethod
    def inertia(self, mass: float) -> Vector:
        """Principal moments about the centre of mass, if homogeneous [kg m^2]."""

    @abstractmethod
    def geoms(self, name: str, rgba: Color = COLOR) -> tuple[Geom, ...]:
        """What it is made of; a geom that stands alone has the given name."""

    def touched(self, name: str, p_O: Vector) -> str:
        """Name of that of its :meth:`geoms` which a hand touches at a place."""
        return name

    @property
    def resting(self) -> str | None:
        """Name of the geom that touches the environment, if it is not the one that hands touch."""
        return None

    @abstractmethod
    def scaled(self, factor: float) -> Shape:
        """So many times as large."""

    def closest(self, p_O: Vector) -> Place:
        """The surface point closest to a point in the object frame [m]."""
        vector("p_O", p_O, 3)
        return self._closest(np.array(p_O, float))

    def place(self, face: str, u: float, v: float) -> Place:
        """A point of a face by its coordinates in [0, 1].

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
    """A vector by its components along an axis and along the two that come after it."""
    return triple(np.roll([along, first, second], AXES.index(axis)))
