"""What kinds of values the keys of a scenario file take; the models are made of them."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Gt, Len
from pydantic import BaseModel, ConfigDict, Field

# Forms of text.
NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"
CORNER = r"^[+-]x ?[+-]y ?[+-]z$"
PREFIX = r"^([A-Za-z][A-Za-z0-9_]*)?$"

Number = Annotated[float, Field(strict=True)]
Positive = Annotated[Number, Gt(0.0)]
NotNegative = Annotated[Number, Ge(0.0)]
Vector3 = Annotated[list[Number], Len(3, 3)]
Size3 = Annotated[list[Positive], Len(3, 3)]
# What bodies, geoms and contacts are called in the simulation, in reports and in recordings.
Name = Annotated[str, Field(pattern=NAME)]
Corner = Annotated[str, Field(pattern=CORNER)]
Colour = Annotated[list[Annotated[Number, Ge(0.0), Field(le=1.0)]], Len(4, 4)]
Text = Annotated[str, Field(min_length=1, max_length=200)]


class Table(BaseModel):
    """A table of the file: no other keys than these, no conversions, no infinite numbers."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        use_attribute_docstrings=True,
        allow_inf_nan=False,
    )


class Placed(Table):
    """Something with a pose."""

    position_m: Vector3 = [0.0, 0.0, 0.0]
    """Position in the world [m]."""

    rpy_deg: Vector3 | None = None
    """Orientation as roll, pitch and yaw about the fixed axes x, y and z, in this order [deg]."""

    quaternion: Annotated[list[Number], Len(4, 4)] | None = None
    """Orientation as a quaternion wxyz, instead of rpy_deg."""
