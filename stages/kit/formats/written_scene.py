"""An interactive scene as it stands in its folder, for whoever writes it in another format."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.link_meshes import Surface, link_surfaces
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import Urdf, parse_urdf


@dataclass(frozen=True)
class WrittenScene:
    """A scene's folder and its scene.json, joints as it was reconstructed. Broken files raise BadInput."""

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
    def link_poses(self) -> dict[str, np.ndarray]:
        """Link -> world_from_link (4, 4) at those values."""
        return link_poses(self.urdf, self.joint_values)

    @cached_property
    def layout(self) -> frozenset[str]:
        """Names of the bodies that are floor, walls or ceiling."""
        vocabulary = load_vocabulary()
        return frozenset(body.name for body in self.info.bodies if vocabulary.by_name(body.class_name).is_layout)

    @cached_property
    def surfaces(self) -> dict[str, list[Surface]]:
        """Link -> what it looks like."""
        return {link.name: link_surfaces(link, self.root) for link in self.urdf.links}
