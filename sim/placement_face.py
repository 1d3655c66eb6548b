"""The face of an object that a hand touches, by two coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.path import rotation
from sim.scenario import Hand, Scenario, Vector
from synthesis import InvalidInputError
from synthesis.contact import Array

# How far off its face a contact may be, to count as on it [m].
_ON_FACE = 1e-3


@dataclass(frozen=True, eq=False)
class Face:
    """A flat face.

    Attributes:
        center_O: Its centre in the object frame [m], (3,).
        axes_O: Its two axes there, (2, 3).
        normal_O: Inward.
        ranges: Of both coordinates [m], as far as contacts may go.
    """

    center_O: Array
    axes_O: Array
    normal_O: Vector
    ranges: tuple[tuple[float, float], tuple[float, float]]

    def coordinates(self, p_O: Vector) -> tuple[float, float]:
        """Coordinates [m] of a point on the face."""
        u, v = self.axes_O @ (np.asarray(p_O, float) - self.center_O)
        return float(u), float(v)

    def place(self, u: float, v: float) -> tuple[Vector, Vector]:
        """The point [m] of two coordinates [m], and the inward normal there."""
        x, y, z = (self.center_O + np.array([u, v]) @ self.axes_O).tolist()
        return (x, y, z), self.normal_O


def face_of(scenario: Scenario, hand: Hand, border: float) -> Face:
    """The face that a hand touches, without a border [m].

    Raises:
        InvalidInputError: The hand touches no flat face, or has no room there.
    """
    geom = next(g for g in scenario.object.geoms if g.name == hand.geom)
    if geom.kind != "box":
        valid = "a hand on a flat face of a geom of kind box, or fixed"
        raise InvalidInputError(f"{hand.name}.geom", f"{geom.name} of kind {geom.kind}", valid)
    R = rotation(geom.pose).as_matrix()
    inward = R.T @ np.asarray(hand.normal_O)
    across = int(np.abs(inward).argmax())
    sign, along = -np.sign(inward[across]), [k for k in range(3) if k != across]
    local = np.zeros(3)
    local[across] = sign * geom.size[across]
    center = R @ local + np.asarray(geom.pose.position)
    axes = R.T[along]
    u, v = axes @ (np.asarray(hand.p_OC_O) - center)
    off = np.asarray(hand.normal_O) @ (np.asarray(hand.p_OC_O) - center)
    if abs(off) > _ON_FACE:
        valid = f"a point of the face of {geom.name}, from which it is {1e3 * abs(off):.0f} mm off"
        raise InvalidInputError(f"{hand.name}.p_OC_O", hand.p_OC_O, valid)
    ranges = []
    for k, now in zip(along, (u, v), strict=True):
        room = max(geom.size[k] - border, 0.0)
        ranges.append((min(-room, float(now)), max(room, float(now))))
    return Face(center, axes, hand.normal_O, (ranges[0], ranges[1]))
