"""What stands beside scene.urdf, for planners, log viewers and headsets: one file of `exporters/` each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.stages.kit.declared import declared_in
from scenewright.stages.kit.formats.written_scene import WrittenScene


@dataclass(frozen=True)
class SceneExporter:
    """A format, as a file of `exporters/` declares it under the name EXPORTER."""

    name: str
    order: int
    """Its place in the order of writing."""
    file: str
    """What it writes in the folder of the scene."""
    write: Callable[[Path, WrittenScene], None]
    """Writes that file; the same scene gives the same bytes."""


def scene_exporters() -> tuple[SceneExporter, ...]:
    """Return every declared exporter in the order of writing."""
    return declared_in("scenewright.stages.urdf.exporters", SceneExporter, "EXPORTER", "scenewright.exporters")


def write_exports(root: Path, scene: InteractiveSceneFile) -> None:
    """Write what every exporter makes of the scene in `root`."""
    written = WrittenScene(root, scene)
    for exporter in scene_exporters():
        exporter.write(root / exporter.file, written)
