"""Where an object of a room stands, and everything that holds it there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from scenewright.stages.synthesize.furniture import Furnishing

Hanging = Literal["supports", "contains", "carries_on_wall", "hangs_from"]


@dataclass(frozen=True)
class Further:
    """What holds an object beside its parent."""

    source: str
    relation: Literal["also_supports", "leans_on"]
    plane: int | None = None
    """Index of the plane that carries, or is touched, in the source's planes."""


@dataclass(frozen=True)
class Pose:
    """A pose under trial and what it would hang on."""

    world_from_model: np.ndarray
    parent: str
    relation: Hanging = "supports"
    plane: int | None = None
    at: str = ""
    """Object whose free floor it may stand in (a chair at its desk) or over (a handle past the edge of its cabinet)."""
    further: tuple[Further, ...] = ()


@dataclass(frozen=True)
class PlacedObject:
    """An object in the room."""

    name: str
    """`<class>_<instance>`."""
    instance: int
    class_name: str
    furnishing: Furnishing
    world_from_model: np.ndarray
    parent: str
    relation: Hanging
    plane: int | None = None
    """Index of the supporting plane in the parent's planes."""
    further: tuple[Further, ...] = ()

    def world_mesh(self) -> trimesh.Trimesh:
        """Visual mesh in the world frame."""
        mesh = self.furnishing.mesh.copy()
        mesh.apply_transform(self.world_from_model)
        return mesh
