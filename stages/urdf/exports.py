"""What stands beside scene.urdf, for planners, log viewers and headsets: one file of `exporters/` each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from schemas.interactive_scene import InteractiveSceneFile
from schemas.vocabulary import load_vocabulary
from stages.kit.declared import declared_in
from stages.kit.formats.urdf_file import Urdf, parse_urdf
from stages.urdf.link_meshes import Surface, link_surfaces


@dataclass(frozen=True)
class WrittenScene:
    """An interactive scene as it stands in its folder, joints as it was reconstructed."""

    root: Path
    info: InteractiveSceneFile

    @cached_property
    def urdf(self) -> Urdf:
        """The whole tree."""
        return parse_urdf(self.root / self.info.combined_file)

    @cached_property
    def joint_values(self) -> dict[str, float]:
        """Joint -> value [rad, m]."""
        return {name: value for body in self.info.bodies for name, value in body.joint_values.items()}

    @cached_property
    def layout(self) -> frozenset[str]:
        """Names of the bodies that are floor, walls or ceiling."""
        vocabulary = load_vocabulary()
        return frozenset(body.name for body in self.info.bodies if vocabulary.by_name(body.class_name).is_layout)

    @cached_property
    def surfaces(self) -> dict[str, list[Surface]]:
        """Link -> what it looks like."""
        return {link.name: link_surfaces(link, self.root) for link in self.urdf.links}


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
    return declared_in("stages.urdf.exporters", SceneExporter, "EXPORTER")


def write_exports(root: Path, scene: InteractiveSceneFile) -> None:
    """Write what every exporter makes of the scene in `root`."""
    written = WrittenScene(root, scene)
    for exporter in scene_exporters():
        exporter.write(root / exporter.file, written)
