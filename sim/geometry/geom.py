"""A geom: a primitive or a mesh, as MuJoCo names them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fulcrum.sim.geometry.pose import Pose
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.checks import positive, vector

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class Geom:
    """A primitive shape of MuJoCo, or a mesh, whose contacts are those of its convex hull.

    Attributes:
        name: Name, unique in the scene.
        kind: Geom type as MuJoCo names it: plane, sphere, capsule, ellipsoid, cylinder, box, mesh.
        size: Sizes as MuJoCo reads them (half extents; radius, half length) [m]; for a mesh its
            scale: one number, or one along each axis.
        pose: Pose in the frame of the owner (object or world).
        rgba: Colour and opacity, each 0 to 1; geoms of opacity 0 are not drawn.
        solid: Whether the robot must keep clear of it, except for tips at their contacts.
        file: Path of the mesh file; None for all other kinds.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    pose: Pose = Pose()
    rgba: tuple[float, float, float, float] = (0.6, 0.6, 0.6, 1.0)
    solid: bool = True
    file: str | None = None

    def __post_init__(self) -> None:
        for size in self.size:
            positive(f"{self.name}.size", size)
        if not 1 <= len(self.size) <= 3:
            raise InvalidInputError(f"{self.name}.size", self.size, "one to three numbers")
        vector(f"{self.name}.rgba", self.rgba, 4)
        if (self.kind == "mesh") != (self.file is not None):
            valid = "a file for the kind mesh, and none for any other"
            raise InvalidInputError(f"{self.name}.file", self.file, valid)
