"""Kind `exported_scene`: an interactive scene written for another simulator, planner or scene graph."""

from __future__ import annotations

from typing import ClassVar

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, RelativePath


class SceneExportFile(Model):
    """export.json: what was written, and what the format could not hold."""

    target: str
    """A format of `export scene` (docs/FORMATS.md)."""
    file: RelativePath
    """What to open, relative to this folder."""
    bodies: int
    movable: int
    joints: int
    names: dict[str, str] = {}
    """Name in the format -> name in the scene, where the format does not allow the latter."""
    joint_zero: dict[str, float] = {}
    """Joint -> value that the format's zero stands for, where that is not 0 [rad, m]."""
    notes: tuple[str, ...] = ()
    """What a reader has to know."""


class ExportedScene(Artifact):
    """`export.json` and the format's own files (docs/FORMATS.md)."""

    kind: ClassVar[str] = "exported_scene"
    description: ClassVar[str] = "a scene written as USD, SDF, MoveIt planning scene or Hydra scene graph"
    info = Document(SceneExportFile, "export.json")
