"""What a method of building the contact graph decides. The table of methods is in stage.py."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.schemas.vocabulary import SemanticClass
from scenewright.stages.graph.nodes import Entity, SmallSupports
from scenewright.stages.graph.support import Candidate


class GraphMethod(Protocol):
    """The decisions in which methods differ; meshes, plane search, tree and refinement are the same for all."""

    @property
    def name(self) -> str:
        """As graph.json has it."""
        ...

    def box(self, points: np.ndarray, normals: np.ndarray, class_name: str) -> tuple[Box, np.ndarray]:
        """Return the box of an object's points (N, 3) [m] with unit normals (N, 3), and which points it is put
        around (N,) bool."""
        ...

    def small_supports(self, semantic: SemanticClass) -> SmallSupports | None:
        """Return which planes too small for the share rule may support something, None when there are none."""
        ...

    def fragments(self, entities: list[Entity]) -> dict[str, str]:
        """Return entities that are no nodes but pieces of another one: name -> name of the whole."""
        ...

    def ranked_candidates(self, entities: list[Entity]) -> dict[str, list[Candidate]]:
        """Return for every object its acceptable relations, best first: support, then wall or ceiling. An object
        without any has an unknown carrier."""
        ...

    def maximum_extension(self, entity: Entity) -> float:
        """Return by how much [m] an object's box may be extended down to its supporting plane."""
        ...

    def relations_beside(self, entities: list[Entity], chosen: dict[str, Candidate]) -> list[Relation]:
        """Return relations beside the tree, in the order of the entities."""
        ...
