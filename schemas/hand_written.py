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

    center: Point
    size: tuple[Edge, Edge, Edge]
    """Full edge lengths [m], the last one up."""
    yaw_degrees: float = Field(0.0, ge=-360, le=360)
