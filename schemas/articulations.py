"""Kind `articulations`: what a log shows in two states, and the joint that takes the one into the other."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Vector3


class Articulation(Model):
    """One part that was seen in two states. World frame of the sequence."""

    type: Literal["revolute", "prismatic"]
    axis: Vector3
    """Unit vector: the part moves along it, or turns about it by the right hand, from the first state to the second."""
    origin: Vector3
    """A point of the axis; of a slide, the middle of the leaf in the first state [m]."""
    travel: float = Field(gt=0)
    """How far it moved [rad] or [m], positive."""
    leaf: tuple[Vector3, ...] = Field(min_length=4, max_length=4)
    """Corners of the rectangle around its largest flat face in the first state [m]."""
    leaf_after: tuple[Vector3, ...] = Field(min_length=4, max_length=4)
    """The same in the second state."""
    last_before: int
    """Last frame (index in the sequence) that shows the first state."""
    first_after: int
    """First frame that shows the second."""
    overlap: float = Field(ge=0, le=1)
    """Share of the face of either state that lies on surface of the other when it is moved, the smaller of the two,
    0 to 1."""


class ArticulationsFile(Model):
    """articulations.json."""

    voxel_size: float = Field(gt=0)
    """Edge of the voxels in which change was looked for [m]."""
    frames: int
    """Frames that were looked at."""
    changed_places: int
    """Connected regions that changed; those that no joint explains (people, moved chairs) are no articulation."""
    articulations: tuple[Articulation, ...]


class Articulations(Artifact):
    """`articulations.json`, and `changes.npz`: `points` (N, 3) float32, centres of the voxels that the parts left or
    came to, and `until` (N,) int32, the last frame that shows what is there no more (`fuse` leaves it out)."""

    kind: ClassVar[str] = "articulations"
    description: ClassVar[str] = "doors and drawers seen in two states: axis, kind and range of their joints"
    info = Document(ArticulationsFile, "articulations.json")
