"""The scenario file as models: the scene, and what happens in it, key by key.

Editors show these docstrings, from the JSON Schema, and `fulcrum new` writes them as comments. The
names of keys contain the units.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import Len
from pydantic import Field

from fulcrum.scenarios.schema.derive import FromTable, derived, same
from fulcrum.scenarios.schema.kinds import (
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
    """Compliance of a contact: a stiffness, or that of a ball on a plane (Hertz) at a load."""

    stiffness_n_per_m: Positive | None = None
    """Normal force per penetration depth [N/m]."""

    youngs_modulus_pa: Positive | None = None
    """Young's modulus of a ball on something much harder [Pa], instead of a stiffness."""

    radius_m: Positive | None = None
    """Radius of the ball [m]."""

    load_n: Positive | None = None
    """Normal force at which the stiffness is evaluated [N]."""

    poisson_ratio: Annotated[float, Field(strict=True, ge=0.0, le=0.5)] = 0.5
    """Poisson's ratio of the ball [-]; rubber has 0.5."""

    damping_s: Positive | None = None
    """Damping over stiffness [s]: the time constant with which a released contact opens."""


class ObjectTable(Placed):
    """The object that is moved. Give exactly one of weight_n, mass_kg and density_kg_per_m3."""

    shape: str
    """box, cylinder, hollow-cylinder or mesh."""

    name: Name = "object"
    """Name of the object."""

    weight_n: Positive | None = None
    """Weight [N], with 9.81 m/s^2."""

    mass_kg: Positive | None = None
    """Mass [kg]."""

    density_kg_per_m3: Positive | None = None
    """Density [kg/m^3]; the mass follows from the shape's volume."""

    center_of_mass_m: Vector3 | None = None
    """Centre of mass in the object's frame [m]; by default that of the shape."""

    inertia_kg_m2: Size3 | None = None
    """Principal moments of inertia about the centre of mass, along the object's axes [kg m^2];
    by default those of the homogeneous shape."""

    rgba: Colour = list(COLOR)
    """Colour and opacity."""


SHAPES: dict[str, type[Shape]] = {
    "box": Box,
    "cylinder": Cylinder,
    "hollow-cylinder": HollowCylinder,
    "mesh": MeshShape,
}


def _object_table(name: str, shape: type[Shape]) -> type[ObjectTable]:
    """Return the table of an object with a shape: keys of any object, and those of the shape."""
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
    """A fixed surface. The object may rest on it if its friction is given."""

    kind: Literal["floor", "table", "step", "post", "wall"]
    """floor: a plane through position_m; table, step: a box, and post: a cylinder, with position_m
    in the middle of the top; wall: a box with position_m in the middle of its front."""

    size_m: Annotated[list[Positive], Len(2, 3)]
    """Lengths along its x, y and z [m]; of a floor along x and y, as far as it is drawn; of a post
    diameter and height."""

    facing: Literal["+x", "-x", "+y", "-y"] | None = None
    """Direction that the front of a wall faces; by default -x."""

    friction: FromTable[Friction] | None = None
    """Friction between surface and object. Without it the object must not touch a solid surface."""

    contact: ContactTable | None = None
    """Compliance of the contact with the object; by default 4e5 N/m and 5 ms."""

    solid: bool = Geom.solid
    """Whether robots must keep clear of it, and the object, too, if there is no friction."""

    rgba: Colour = [0.75, 0.77, 0.80, 1.0]
    """Colour and opacity."""


class HandTable(FileTable):
    """A hand of a robot, and where it touches the object: on a face, or at a point."""

    mount: Text
    """Body of the robot that carries the hand, with the robot's prefix."""

    mount_position_m: Vector3 | None = None
    """Position of the hand on that body [m]; by default its origin."""

    mount_rpy_deg: Vector3 | None = None
    """Orientation of the hand on that body: roll, pitch and yaw [deg]."""

    tip: Text = "palm_pad"
    """palm_pad, finger_tip, or an MJCF file with a body `pad`, a spherical geom `tip` and a site
    `tip_center`."""

    face: Face | None = None
    """Face of the object that the hand touches; a box has +x, -x, +y, -y, +z and -z."""

    at: Place2 | None = None
    """Place on the face, from 0 to 1 along each of its two directions; by default the middle."""

    point_m: Vector3 | None = None
    """Contact point in the object's frame [m], instead of face and at."""

    normal: Direction | None = None
    """Normal into the object, in its axes; by default that of the surface."""

    tangent: Direction | None = None
    """First tangent, which is the x axis of the tip; by default z as far as it is perpendicular to
    the normal, or x where the normal is along z."""

    may_touch: list[Face] | None = None
    """Faces to which `fulcrum place` may move the hand; by default its own."""

    friction: FromTable[Friction]
    """Friction between tip and object."""

    contact: ContactTable | None = None
    """Compliance of the contact with the object; by default that of a rubber ball of 30 mm and
    2 MPa under 50 N: 4e4 N/m and 2 ms."""

    grip_limit_n: Positive | None = None
    """Largest normal force [N]; by default unlimited."""


class SupportTable(FileTable):
    """A point or corner of the object that stays on a surface while the object tilts."""

    surface: Name
    """Name of that surface, in the environment."""

    corner: Corner | None = None
    """Corner of the box, like "-x +y -z"."""

    point_m: Vector3 | None = None
    """The point in the object's frame [m], instead of a corner."""

    normal: Direction | None = None
    """Normal into the object, in world axes; by default that of the surface."""

    tangent: Direction | None = None
    """First tangent, in world axes; by default z as far as it is perpendicular to the normal, or x
    where the normal is along z."""


class ScenarioFile(FileTable):
    """A scenario: object, environment, hands, robots, path, control, and what counts as success."""

    summary: Text = same(Scenario, "summary")

    object: AnyObject
    """The object that is moved."""

    environment: dict[Name, SurfaceTable]
    """Fixed surfaces, by name."""

    hands: Annotated[dict[Name, HandTable], Len(1)]
    """Hands of the robots, by name; they hold the object along the whole path."""

    supports: dict[Name, SupportTable] = {}
    """Points of the object that stay on the environment, by name of the contact."""

    robots: Annotated[list[RobotTable], Len(1)]
    """The robots."""

    path: AnyPath
    """Path of the object."""

    holdable: bool = same(Scenario, "holdable")

    manoeuvre: ManoeuvreTable = ManoeuvreTable()
    """Timing of the phases."""

    control: FromTable[Control] = Field(default_factory=Control)
    """Settings of the force synthesis and of the controller."""

    physics: FromTable[Physics] = Field(default_factory=Physics)
    """Settings of the contact solver."""

    tolerances: FromTable[Tolerances] = Field(default_factory=Tolerances)
    """What counts as success."""

    view: FromTable[View] = Field(default_factory=View)
    """Viewpoint of recordings."""


class LiftedFile(FileTable):
    """Another scenario without its supports: the object is lifted off."""

    summary: Text = same(Scenario, "summary")

    lifted_from: Text
    """The other scenario: its name, or its file relative to this one."""

    travel_m: Vector3 = [0.0, 0.0, 0.1]
    """Translation besides the tilt, proportional to it, at the end of the tilt [m]."""

    after: After = "hold"
    """What follows the tilt: hold or leave."""
