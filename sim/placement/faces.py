"""Places on an object's faces at which a hand may hold it, by two coordinates of a face."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from fulcrum.sim.geometry import Shape, triple
from fulcrum.sim.model import across
from fulcrum.sim.scenario import Hand, Scenario
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Array, Vector

Range = tuple[float, float]

# Largest distance from a face of a contact that counts as on it [m].
_ON_FACE = 1e-3
# Numbers of steps for measuring a face, and for finding the coordinates of a contact.
_MEASURED, _SOUGHT = 64, 32
# Digits of coordinates: 0.1 mm on a face of one metre.
_DIGITS = 4


@dataclass(frozen=True, eq=False)
class Faces:
    """The faces that a hand may touch.

    Attributes:
        hand: Hand at its present place.
        shape: Shape of the object.
        names: Names of the faces, the present one first.
        now: Coordinates of the hand's place on the present face [-].
        ranges: Ranges of the coordinates u and v on each face, without its border [-].
    """

    hand: Hand
    shape: Shape
    names: tuple[str, ...]
    now: tuple[float, float]
    ranges: tuple[tuple[Range, Range], ...]

    def held(self, face: float, u: float, v: float) -> Hand:
        """Return the hand at another place; its axes are turned along with the normal.

        Args:
            face: Face, as a share of the number of faces [-]: from 0, the first, to 1, the last.
            u, v: Coordinates, as shares of their ranges [-].
        """
        index = min(int(face * len(self.names)), len(self.names) - 1)
        shares = zip(self.ranges[index], (u, v), strict=True)
        at = [round(low + share * (high - low), _DIGITS) for (low, high), share in shares]
        place = self.shape.place(self.names[index], *at)
        return moved(self.hand, place.point, place.normal, self.shape)

    @property
    def shares(self) -> tuple[float, float]:
        """The present coordinates as shares of their ranges [-]."""
        u, v = (
            (now - low) / (high - low) if high > low else 0.5
            for now, (low, high) in zip(self.now, self.ranges[0], strict=True)
        )
        return u, v


def faces_of(scenario: Scenario, hand: Hand, allowed: tuple[str, ...], border: float) -> Faces:
    """Return the faces that a hand may touch.

    Args:
        scenario: Scene.
        hand: One of its hands.
        allowed: Names of faces; the present face of the hand may be left out.
        border: Distance that contacts keep from the ends of a face [m].

    Raises:
        InvalidInputError: The object has no shape or no such face, or the hand is on no face.
    """
    shape = shape_of(scenario)
    for name in allowed:
        if name not in shape.faces:
            valid = f"one of {', '.join(shape.faces)}"
            raise InvalidInputError(f"{hand.name}: face", name, valid)
    place = shape.closest(hand.p_OC_O)
    off = float(np.linalg.norm(np.subtract(place.point, hand.p_OC_O)))
    if off > _ON_FACE:
        near = ", ".join(f"{x:.4g}" for x in place.point)
        valid = f"a point of the surface, such as the nearest one, ({near}), {1e3 * off:.0f} mm off"
        raise InvalidInputError(f"{hand.name}.p_OC_O", hand.p_OC_O, valid)
    names = tuple(dict.fromkeys((place.face, *allowed)))
    now = coordinates(shape, place.face, hand.p_OC_O)
    ranges = [_ranges(shape, name, border) for name in names]
    ranges[0] = _containing(ranges[0][0], now[0]), _containing(ranges[0][1], now[1])
    return Faces(hand, shape, names, now, tuple(ranges))


def shape_of(scenario: Scenario) -> Shape:
    """Return the object's shape.

    Raises:
        InvalidInputError: The object has no shape.
    """
    thing = scenario.object
    if thing.shape is None:
        valid = "a shape on whose faces contacts may move, or contacts that stay"
        raise InvalidInputError(f"{thing.name}.shape", "none", valid)
    return thing.shape


def moved(hand: Hand, point: Vector, normal: Vector, shape: Shape) -> Hand:
    """Return a hand at another place; its tangent is rotated along with its normal."""
    if normal == hand.normal_O:
        return replace(hand, p_OC_O=point, geom=shape.touched(hand.geom, point))
    old, new = np.asarray(hand.normal_O, float), np.asarray(normal, float)
    axis, cosine = np.cross(old, new), float(old @ new)
    sine = float(np.linalg.norm(axis))
    # For the opposite face the rotation is about the tangent, which therefore stays.
    turn = np.zeros(3) if sine < 1e-9 else np.arctan2(sine, cosine) / sine * axis
    tangent = across(Rotation.from_rotvec(turn).apply(hand.tangent_O), new)
    geom = shape.touched(hand.geom, point)
    return replace(hand, p_OC_O=point, normal_O=normal, tangent_O=triple(tangent), geom=geom)


def coordinates(shape: Shape, face: str, p_O: Vector) -> tuple[float, float]:
    """Return the coordinates of a point of a face, found by search for all shapes."""

    def distance(at: Array) -> float:
        u, v = np.clip(at, 0.0, 1.0).tolist()
        return float(np.linalg.norm(np.subtract(shape.place(face, u, v).point, p_O)))

    grid = [(i / _SOUGHT, j / _SOUGHT) for i in range(_SOUGHT + 1) for j in range(_SOUGHT + 1)]
    first = min(grid, key=lambda at: distance(np.array(at)))
    options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 2000, "maxfev": 2000}
    found = minimize(distance, first, method="Nelder-Mead", options=options)
    u, v = np.clip(found.x, 0.0, 1.0).tolist()
    return u, v


def _ranges(shape: Shape, face: str, border: float) -> tuple[Range, Range]:
    """Return the ranges of both coordinates, without a border [m] where the face ends."""
    ranges = []
    for k in range(2):
        at = np.full((_MEASURED + 1, 2), 0.5)
        at[:, k] = np.linspace(0.0, 1.0, _MEASURED + 1)
        points = np.array([shape.place(face, *uv).point for uv in at.tolist()])
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        closed = np.linalg.norm(points[0] - points[-1]) < _ON_FACE
        room = 0.0 if closed else min(border / length, 0.5)
        ranges.append((room, 1.0 - room))
    return ranges[0], ranges[1]


def _containing(ends: Range, value: float) -> Range:
    return min(ends[0], value), max(ends[1], value)
