"""Write everything of kind interactive_scene: URDF trees, a file per movable body, MJCF, meshes (Han 2024, 2.4.5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

from schemas.cad_library import CadModel
from schemas.contact_graph import ContactGraphFile
from schemas.interactive_scene import InteractiveSceneFile
from schemas.scene_parts import Box


@dataclass(frozen=True)
class BundleBody:
    """One node of the scene: a posed CAD model, or a mesh of its own (layout, or nothing in the library fits)."""

    name: str
    """Node id of the contact graph."""
    class_name: str
    parent: str | None
    """Name of the body that carries it; None (or `scene`) for those that hang on the world."""
    relation: str
    world_from_body: np.ndarray
    """(4, 4), rigid; the scale is apart."""
    movable: bool
    box: Box
    """World frame."""
    model: CadModel | None = None
    model_folder: Path | None = None
    scale: float = 1.0
    joint_values: dict[str, float] = field(default_factory=dict)
    """The model's joint names -> values at scale 1."""
    mesh: trimesh.Trimesh | None = None
    """Body frame; for bodies without CAD model."""
    mass: float | None = None
    """[kg]; from the model or the volume when None."""


def write_scene_bundle(root: Path, bodies: list[BundleBody], graph: ContactGraphFile) -> InteractiveSceneFile:
    """Write kind interactive_scene into `root` and return what stands in scene.json. Raises BadInput."""
    raise NotImplementedError("being written")
