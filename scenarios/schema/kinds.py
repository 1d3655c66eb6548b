"""The kinds of values that keys of a scenario file take."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Len
from pydantic import BaseModel, ConfigDict, Field

from fulcrum.synthesis.settings import Positive, Share

# Forms of text.
NAME = r"^[A-Za-z][A-Za-z0-9_-]*$"
CORNER = r"^[+-]x ?[+-]y ?[+-]z$"
PREFIX = r"^([A-Za-z][A-Za-z0-9_]*)?$"

Vector3 = Annotated[list[float], Len(3, 3), Field(examples=[[0.0, 0.0, 0.0]])]
# Directions need not be of length 1.
Direction = Annotated[list[float], Len(3, 3), Field(examples=[[0.0, 0.0, 1.0]])]
Quaternion4 = Annotated[list[float], Len(4, 4), Field(examples=[[1.0, 0.0, 0.0, 0.0]])]
# A place on a face, along each of its two coordinates.
Place2 = Annotated[list[Share], Len(2, 2), Field(examples=[[0.5, 0.5]])]
Size3 = Annotated[list[Positive], Len(3, 3), Field(examples=[[0.01, 0.01, 0.01]])]
# Names of bodies, geoms and contacts in the simulation, in reports and in recordings.
Name = Annotated[str, Field(pattern=NAME)]
Corner = Annotated[str, Field(pattern=CORNER, examples=["-x +y -z"])]
Colour = Annotated[list[Share], Len(4, 4)]
Face = Annotated[str, Field(max_length=20, examples=["+y"])]


class FileTable(BaseModel):
    """A table of the file: no unknown keys, no conversions, no infinite numbers."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        use_attribute_docstrings=True,
        allow_inf_nan=False,
    )


class Placed(FileTable):
    """Something with a pose."""

    position_m: Vector3 = [0.0, 0.0, 0.0]
    """Position in the world [m]."""

    rpy_deg: Vector3 | None = None
    """Orientation as roll, pitch and yaw about the fixed axes x, y and z, in this order [deg]."""

    quaternion: Quaternion4 | None = None
    """Orientation as a quaternion wxyz, instead of rpy_deg."""
