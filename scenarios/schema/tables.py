"""The scenario file as models: what is in the scene and who tilts it, key by key.

What these docstrings say is what editors show, from the JSON Schema, and what `fulcrum new` writes
as comments. Units stand in the names of the keys.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import Len
from pydantic import Field

from fulcrum.scenarios.schema.derive import FromTable, derived, same
from fulcrum.scenarios.schema.keys import (
    Colour,
    Corner,
    Direction,
    Face,
    FileTable,
    Name,
    Place2,
    Placed,
    Size3,
    Vector3,
)
from fulcrum.scenarios.schema.motion import After, AnyPath, ManoeuvreTable, RobotTable
from fulcrum.sim.geometry import COLOR, Geom, Shape
from fulcrum.sim.geometry.shapes import Box, Cylinder, HollowCylinder, MeshShape
from fulcrum.sim.scenario import Control, Friction, Physics, Scenario, Tolerances, View
from fulcrum.synthesis.settings import Positive, Text


class ContactTable(FileTable):
    """How a contact gives way: its stiffness, or that of a ball on a flat by Hertz at a load."""

    stiffness_n_per_m: Positive | None = None
    """Normal force per depth [N/m]."""

    youngs_modulus_pa: Positive | None = None
    """Young's modulus of a ball on something much harder [Pa], instead of a stiffness."""

    radius_m: Positive | None = None
    """Radius of the ball [m]."""

    load_n: Positive | None = None
    """Normal force at which its stiffness is taken [N]."""

    poisson_ratio: Annotated[float, Field(strict=True, ge=0.0, le=0.5)] = 0.5
    """Poisson's ratio of the ball [-]; rubber has 0.5."""

    damping_s: Positive | None = None
    """Damping over stiffness [s]: the time in which a contact opens that is let go."""


class ObjectTable(Placed):
    """The thing that is tilted. It needs exactly one of weight_n, mass_kg, density_kg_per_m3."""

    shape: str
    """box, cylinder, hollow-cylinder or mesh."""

    name: Name = "object"
    """What it is called."""

    weight_n: Positive | None = None
    """Weight [N], with 9.81 m/s^2."""

    mass_kg: Positive | None = None
    """Mass [kg]."""

    density_kg_per_m3: Positive | None = None
    """Density [kg/m^3]; the mass follows from the shape's volume."""

    center_of_mass_m: Vector3 | None = None
    """Centre of mass in the object's frame [m]; the shape's, if it is left out."""

    inertia_kg_m2: Size3 | None = None
    """Principal moments of inertia about the centre of mass, along the object's axes [kg m^2];
    those of the homogeneous shape, if they are left out."""

    rgba: Colour = list(COLOR)
    """Colour and opacity."""


SHAPES: dict[str, type[Shape]] = {
    "box": Box,
    "cylinder": Cylinder,
    "hollow-cylinder": HollowCylinder,
    "mesh": MeshShape,
}


def _object_table(name: str, shape: type[Shape]) -> type[ObjectTable]:
    """The table of an object with a shape: keys of any object, and those of the shape."""
    tag: Any = (Literal[name], Field(description=ObjectTable.model_fields["shape"].description))
    return derived(f"{shape.__name__}FileTable", ObjectTable, shape, shape=tag)


if TYPE_CHECKING:
    AnyObject = ObjectTable
else:
    AnyObject = Annotated[
        reduce(or_, [_object_table(*item) for item in SHAPES.items()]),
        Field(discriminator="shape"),
    ]


class SurfaceTable(Placed):
    """Something that stands fast. The object may lie on it if its friction is given."""

    kind: Literal["floor", "table", "step", "post", "wall"]
    """floor is a plane through position_m; table and step are boxes and post is a cylinder with
    position_m in the middle of their top; wall is a box with it in the middle of its front."""

    size_m: Annotated[list[Positive], Len(2, 3)]
    """Lengths along its x, y and z [m]; of a floor along x and y, as far as it is drawn; diameter
    and height of a post."""

    facing: Literal["+x", "-x", "+y", "-y"] | None = None
    """Where the front of a wall looks; -x if it is left out."""

    friction: FromTable[Friction] | None = None
    """Between it and the object. Without, the object must not touch it, if it is solid."""

    contact: ContactTable | None = None
    """How it and the object give way to each other; 4e5 N/m and 5 ms, if it is left out."""

    solid: bool = Geom.solid
    """Whether the robots must keep clear of it, and the object too, if it has no friction."""

    rgba: Colour = [0.75, 0.77, 0.80, 1.0]
    """Colour and opacity."""


class HandTable(FileTable):
    """A robot's hand, and where it holds the object: at a face, or at a point."""

    mount: Text
    """The robot's body that carries it, with the robot's prefix."""

    mount_position_m: Vector3 | None = None
    """Where on that body it sits [m]; at its origin, if it is left out."""

    mount_rpy_deg: Vector3 | None = None
    """How it is turned there: roll, pitch and yaw [deg]."""

    tip: Text = "palm_pad"
    """palm_pad, finger_tip, or an MJCF file with a body `pad`, a spherical geom `tip` and a site
    `tip_center`."""

    face: Face | None = None
    """Face of the object that it touches: of a box +x, -x, +y, -y, +z, -z."""

    at: Place2 | None = None
    """Where on the face, from 0 to 1 along each of its two directions; its middle, if left out."""

    point_m: Vector3 | None = None
    """Where it touches, in the object's frame [m], instead of face and at."""

    normal: Direction | None = None
    """Inward normal there, in the object's axes; that of the surface, if it is left out."""

    tangent: Direction | None = None
    """First tangent there, which is the x axis of the tip; z across the normal, if it is left out,
    or x where the normal is along z."""

    may_touch: list[Face] | None = None
    """Faces to which `fulcrum place` may move it; its own, if they are left out."""

    friction: FromTable[Friction]
    """Between tip and object."""

    contact: ContactTable | None = None
    """How tip and object give way to each other; as a rubber ball of 30 mm and 2 MPa under 50 N, if
    it is left out: 4e4 N/m and 2 ms."""

    grip_limit_n: Positive | None = None
    """Largest normal force [N]; none, if it is left out."""


class SupportTable(FileTable):
    """A point of the object, or a corner, that stays on a surface while the object tilts."""

    surface: Name
    """The surface that it stays on."""

    corner: Corner | None = None
    """Corner of the box, like "-x +y -z"."""

    point_m: Vector3 | None = None
    """The point in the object's frame [m], instead of a corner."""

    normal: Direction | None = None
    """Normal into the object, in world axes; that of the surface, if it is left out."""

    tangent: Direction | None = None
    """First tangent, in world axes; z across the normal, if it is left out, or x where the normal
    is along z."""


class ScenarioFile(FileTable):
    """A scenario: what is tilted, on what, by whom, along which path, and what is success."""

    summary: Text = same(Scenario, "summary")

    object: AnyObject
    """The thing that is tilted."""

    environment: dict[Name, SurfaceTable]
    """What stands fast, by name."""

    hands: Annotated[dict[Name, HandTable], Len(1)]
    """The robots' hands, by name: they hold the object all the way."""

    supports: dict[Name, SupportTable] = {}
    """Points of the object that stay on the environment, by name."""

    robots: Annotated[list[RobotTable], Len(1)]
    """The robots."""

    path: AnyPath
    """How the object is to move."""

    holdable: bool = same(Scenario, "holdable")

    manoeuvre: ManoeuvreTable = ManoeuvreTable()
    """Timing of the phases."""

    control: FromTable[Control] = Field(default_factory=Control)
    """How forces are synthesised and followed."""

    physics: FromTable[Physics] = Field(default_factory=Physics)
    """Settings of the contact solver."""

    tolerances: FromTable[Tolerances] = Field(default_factory=Tolerances)
    """What counts as success."""

    view: FromTable[View] = Field(default_factory=View)
    """Where recordings look from."""


class LiftedFile(FileTable):
    """A scenario like another one, without the environment's help: the object is to come off."""

    summary: Text = same(Scenario, "summary")

    lifted_from: Text
    """The other one: its name, or its file relative to this one."""

    travel_m: Vector3 = [0.0, 0.0, 0.1]
    """Translation on top of the tilt, in proportion to it, at the end [m]."""

    after: After = "hold"
    """What comes after the tilt."""
