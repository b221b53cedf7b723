"""The contact graph as the thesis words it: equations 2.1 to 2.3 and nothing else (Han 2024, section 2.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.schemas.vocabulary import SemanticClass
from scenewright.stages.graph.nodes import Entity, SmallSupports, level_patch
from scenewright.stages.graph.observed_box import BoxFit, observed_box
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.support import (
    ORDER_TOLERANCE,
    Candidate,
    best_first,
    height_gap,
    inside_share,
    possible_parents,
    stands_inside,
    support_score,
)
from scenewright.stages.graph.tree import objects_of, upright_layout
from scenewright.stages.graph.walls import search_trees, wall_candidate
from scenewright.stages.kit.geometry.boxes import clip_polygon, footprint, transform_points_to_box
from scenewright.stages.kit.geometry.planes import plane_height


@dataclass(frozen=True)
class Thesis:
    """The baseline (`GraphMethod`). Whoever corrects something does it in ours.py."""

    parameters: GraphParameters

    @property
    def name(self) -> str:
        """As graph.json has it."""
        return "thesis"

    def box(self, points: np.ndarray, normals: np.ndarray, class_name: str) -> tuple[Box, np.ndarray]:
        """Return the least box of what is no stray."""
        fit = BoxFit(self.parameters.stray_share, self.parameters.stray_distance)
        return observed_box(points, normals, fit)

    def small_supports(self, semantic: SemanticClass) -> SmallSupports | None:
        """Only planes with a tenth of an entity's points are planes."""
        return None

    def fragments(self, entities: list[Entity]) -> dict[str, str]:
        """No entity is taken for a piece of another."""
        return {}

    def ranked_candidates(self, entities: list[Entity]) -> dict[str, list[Candidate]]:
        """Return supports by (2.3), then the nearest wall. Ceilings count as walls."""
        walls = upright_layout(entities)
        trees = search_trees(walls)
        ranked: dict[str, list[Candidate]] = {}
        for child in objects_of(entities):
            wall = wall_candidate(child, walls, self.parameters.wall_distance, trees)
            on_wall = [] if wall is None else [wall]
            ranked[child.name] = [*candidates_for(child, entities, self.parameters), *on_wall]
        return ranked

    def maximum_extension(self, entity: Entity) -> float:
        """The same for all [m]."""
        return self.parameters.maximum_extension

    def relations_beside(self, entities: list[Entity], chosen: dict[str, Candidate]) -> list[Relation]:
        """One carrier an object, and nothing leans."""
        return []


def rectangle_overlap(points: np.ndarray, child: Box) -> float:
    """Equation 2.2 as the thesis words it: the share of the child's footprint that the rectangle (parallel to the
    child's box) around those points (K, 3) near the plane takes up, which lie within the footprint."""
    local = transform_points_to_box(child, points)[:, :2]
    half = np.asarray(child.size[:2]) / 2
    inside = local[np.all(np.abs(local) <= half + 1e-9, axis=1)]
    area = float(child.size[0] * child.size[1])
    if len(inside) < 2 or area <= 0.0:
        return 0.0
    return float(np.prod(np.ptp(inside, axis=0))) / area


def candidates_for(child: Entity, entities: list[Entity], parameters: GraphParameters) -> list[Candidate]:
    """Return every acceptable supporting relation of one object, best first (section 2.2.2).

    A relation is acceptable when (2.1) and (2.2) hold within a_th and b_th and the score (2.3) reaches
    `minimum_score`.
    """
    candidates: list[Candidate] = []
    for parent in possible_parents(child, entities):
        seen_candidates = [seen_candidate(child, parent, k, parameters) for k in parent.supporting]
        accepted = [candidate for candidate in seen_candidates if candidate is not None]
        candidates += accepted
        if not accepted and parent.node_type != "layout":
            hidden = hidden_candidate(child, parent, parameters)
            if hidden is not None:
                candidates.append(hidden)
    return best_first(candidates, entities)


def seen_candidate(child: Entity, parent: Entity, k: int, parameters: GraphParameters) -> Candidate | None:
    """Return the relation over the parent's patch `k`, or None where (2.2) or (2.3) falls short."""
    patch = parent.patches[k]
    height = plane_height(patch.plane, np.asarray(child.box.center[:2]))
    gap = height_gap(child.box, patch)
    overlap = rectangle_overlap(patch.points, child.box)
    score = support_score(gap, overlap)
    if overlap < parameters.area_threshold or score < parameters.minimum_score:
        return None
    relation: Literal["supports", "contains"] = (
        "contains" if stands_inside(child, parent, height, container=parent.is_container) else "supports"
    )
    return Candidate(child.name, parent.name, score, relation, gap, overlap, height, k)


def hidden_candidate(child: Entity, parent: Entity, parameters: GraphParameters) -> Candidate | None:
    """Return the relation over a supporting plane that nobody saw, or None.

    "When v_c is well-overlapped with v_i but v_i has no valid supporting plane, the bottom plane of v_c will be
    registered as a new supporting plane of v_i" (section 2.2.2). There is no limit on where.
    """
    share = inside_share(child.box, parent.box)
    outline = clip_polygon(footprint(parent.box), footprint(child.box))
    if share < parameters.area_threshold or len(outline) < 3 or parent.supporting:
        return None
    score = support_score(0.0, share)
    if score < parameters.minimum_score:
        return None
    height = child.bottom
    inside = (
        stands_inside(child, parent, height, container=parent.is_container)
        and height >= parent.bottom - ORDER_TOLERANCE
    )
    relation: Literal["supports", "contains"] = "contains" if inside else "supports"
    patch = level_patch(outline, height, hidden=True)
    return Candidate(child.name, parent.name, score, relation, 0.0, share, height, None, patch)
