"""What people write down about a scene by hand: places and boxes in its world, with bounds."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from scenewright.schemas.base import Model

LARGEST_LENGTH = 1e4
"""Largest length [m]: nothing stands farther from the origin, or is larger."""

Coordinate = Annotated[float, Field(ge=-LARGEST_LENGTH, le=LARGEST_LENGTH)]
Edge = Annotated[float, Field(gt=0, le=LARGEST_LENGTH)]
Point = tuple[Coordinate, Coordinate, Coordinate]
"""In the world frame [m]."""


class UprightBox(Model):
    """A box that stands upright in the world."""

    center: Point = Field(description="Middle of the box in the world: x y z [m].")
    size: tuple[Edge, Edge, Edge] = Field(description="Full edge lengths of the box, the last one up [m].")
    yaw_degrees: float = Field(0.0, ge=-360, le=360, description="Turn of the box about the vertical [degrees].")
