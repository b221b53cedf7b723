"""Contact graphs, CAD models and the scenes made of them."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from schemas.cad_library import CadModel, LibraryFile
from schemas.cad_scene import CadSceneFile, Replacement
from schemas.contact_graph import ContactGraphFile
from schemas.interactive_scene import InteractiveSceneFile, SceneBody
from stages.engine.loading.artifact import LoadedArtifact
from stages.engine.loading.graphs import as_networkx


class _WithGraph(LoadedArtifact):
    @cached_property
    def graph_file(self) -> ContactGraphFile:
        """graph.json."""
        return ContactGraphFile.read(self.path / "graph.json")

    @cached_property
    def graph(self) -> Any:
        """The contact graph, a networkx.MultiDiGraph: node id -> class_name, node_type, box, planes, ...; edges have
        `relation` (supports, contains, carries_on_wall, hangs_from, also_supports, leans_on from carrier to carried;
        proximal)."""
        return as_networkx(self.graph_file)


class LoadedContactGraph(_WithGraph):
    """Kind `contact_graph`."""

    def parent(self, node: str) -> str | None:
        """Return what carries or contains a node; None for the root."""
        link = self.graph_file.parent_link(node)
        return link.source if link else None

    def children(self, node: str) -> tuple[str, ...]:
        """Return what a node carries or contains."""
        return self.graph_file.children(node)


class LoadedCadLibrary(LoadedArtifact):
    """Kind `cad_library`."""

    @cached_property
    def models(self) -> dict[str, CadModel]:
        """Model id -> class, joints, parts, mass, surface planes."""
        return {model.id: model for model in LibraryFile.read(self.path / "library.json").models}

    def urdf_path(self, model: str) -> Path:
        """Return the URDF of a model. Raises BadInput for an unknown one."""
        return self.file(f"models/{model}/model.urdf")


class LoadedCadScene(_WithGraph):
    """Kind `cad_scene`: which CAD model stands for which object."""

    @cached_property
    def info(self) -> CadSceneFile:
        """scene.json."""
        return CadSceneFile.read(self.path / "scene.json")

    @property
    def replacements(self) -> dict[str, Replacement]:
        """Node id -> decision, chosen model with pose and errors, alternatives."""
        return {entry.node: entry for entry in self.info.replacements}


class LoadedInteractiveScene(_WithGraph):
    """Kind `interactive_scene`: what simulators and robots load."""

    @cached_property
    def info(self) -> InteractiveSceneFile:
        """scene.json."""
        return InteractiveSceneFile.read(self.path / "scene.json")

    @property
    def urdf_path(self) -> Path:
        """The whole kinematic tree, for ROS tools and yourdfpy; pybullet loads `static_urdf_path` and each body."""
        return self.path / self.info.combined_file

    @property
    def static_urdf_path(self) -> Path:
        """Everything that does not move as a whole."""
        return self.path / self.info.static_file

    @property
    def mjcf_path(self) -> Path:
        """The same scene for MuJoCo."""
        return self.file("scene.mjcf.xml")

    @property
    def bodies(self) -> tuple[SceneBody, ...]:
        """Every body: class, joints with their values, box, mass."""
        return self.info.bodies

    def world_from_body(self, name: str) -> np.ndarray:
        """Return the pose (4, 4) of a body. Raises KeyError."""
        for body in self.bodies:
            if body.name == name:
                return np.array(body.world_from_body)
        raise KeyError(name)
