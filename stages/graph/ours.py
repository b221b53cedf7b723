"""Ours: the thesis's contact graph with what a map of a real room asks for beside (docs/SCENES.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.schemas.vocabulary import UNNAMED, SemanticClass
from scenewright.stages.graph.balance import TOUCH
from scenewright.stages.graph.beside import relations_beside
from scenewright.stages.graph.corrected_support import HIDDEN_TOP_DISTANCE, candidates_for, hull_overlap
from scenewright.stages.graph.hanging import hanging_candidate
from scenewright.stages.graph.nodes import Entity, Patch, SmallSupports
from scenewright.stages.graph.observed_box import BoxFit, observed_box
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.shared_support import PART_SHARE, shared_candidates
from scenewright.stages.graph.support import Candidate, height_gap
from scenewright.stages.graph.touching import touches
from scenewright.stages.graph.tree import objects_of, upright_layout
from scenewright.stages.graph.walls import search_trees, wall_candidate
from scenewright.stages.kit.geometry.boxes import box_volume, boxes_overlap_volume, points_in_box
from scenewright.stages.kit.geometry.steadiness import stands_steadily

LEDGE_AREA = 0.05
"""Least area of a supporting surface in a wall entity [m^2]."""
LEDGE_GAP = 0.2
"""Gap between supporting surfaces of one wall entity [m]."""
PIECE_SHARE = 0.7
"""Share of its box that a piece has within the whole."""
BOARD, SLENDER = 0.08, 0.25
"""Boards, posts and bars of furniture are thinner than this [m], and than this share of their length; by eye."""
MOVABLE_REACH = 1 / 3
"""Movable things have to be this much nearer to a wall to hang on it."""
HUNG, HUNG_DEPTH = frozenset({"wall_cabinet", "wall_shelf"}), 0.45
"""What has its name from its wall hangs there, if it is no farther away than such things are deep [m]: of some only
the front is seen."""


@dataclass(frozen=True)
class Ours:
    """The corrected method (`GraphMethod`)."""

    parameters: GraphParameters

    @property
    def name(self) -> str:
        """As graph.json has it."""
        return "ours"

    def box(self, points: np.ndarray, normals: np.ndarray, class_name: str) -> tuple[Box, np.ndarray]:
        """Return the box that turns with the sides, or is put around a disc, without what leaked."""
        fit = BoxFit(
            self.parameters.stray_share,
            self.parameters.stray_distance,
            trim=self.parameters.box_trim,
            side_share=self.parameters.side_share,
            may_be_round=class_name in self.parameters.round_classes,
        )
        return observed_box(points, normals, fit)

    def small_supports(self, semantic: SemanticClass) -> SmallSupports | None:
        """Return which small planes may support, None for floors and ceilings."""
        if semantic.name in ("floor", "ceiling"):
            return None
        if semantic.is_layout:
            # Window sills, and furniture that was taken for a piece of the wall behind it.
            return SmallSupports(LEDGE_AREA, LEDGE_GAP)
        return SmallSupports(self.parameters.minimum_support_area)

    def fragments(self, entities: list[Entity]) -> dict[str, str]:
        """Return entities that can only be pieces of another one: name -> name of the whole."""
        return fragments(entities)

    def ranked_candidates(self, entities: list[Entity]) -> dict[str, list[Candidate]]:
        """Return supports (two carriers together where none reaches up), then wall or ceiling."""
        parameters = self.parameters
        ceilings = [entity for entity in entities if entity.class_name == "ceiling"]
        walls = [entity for entity in upright_layout(entities) if entity not in ceilings]
        trees = search_trees(walls)
        ranked: dict[str, list[Candidate]] = {}
        for child in objects_of(entities):
            choices = candidates_for(child, entities, parameters)
            close = [c for c in choices if abs(c.gap) <= HIDDEN_TOP_DISTANCE and c.overlap >= parameters.area_threshold]
            if not close:
                # Two in contact come before one that is deeper, and before one of them alone.
                choices = [*shared_candidates(child, entities, parameters), *choices]
            # A cup does not hang on the wall that the desk, which the map lacks, stands at.
            reach = parameters.wall_distance * (MOVABLE_REACH if child.movable else 1.0)
            to_wall = max(reach, HUNG_DEPTH) if child.class_name in HUNG else reach
            wall = wall_candidate(child, walls, to_wall, trees)
            hanging = hanging_candidate(child, ceilings, reach)
            held_up = [candidate for candidate in (wall, hanging) if candidate is not None]
            ranked[child.name] = [*choices, *sorted(held_up, key=lambda candidate: -candidate.score)]
        return ranked

    def maximum_extension(self, entity: Entity) -> float:
        """Furniture misses its legs; a cup does not lose its lower half metre [m]."""
        most = self.parameters.maximum_extension
        return min(most, self.parameters.movable_gap) if entity.movable else most

    def relations_beside(self, entities: list[Entity], chosen: dict[str, Candidate]) -> list[Relation]:
        """Return further carriers, and what keeps an object from falling over."""
        return relations_beside(entities, chosen, self.parameters)


def fragments(entities: list[Entity]) -> dict[str, str]:
    """Return entities that can only be pieces of another one: name -> name of the whole.

    Furniture of one class does not interpenetrate, so a chair whose box lies within the box of a larger chair is a
    part of it that the map failed to merge. Small things of one class do lie in each other (bowls, boxes), and what
    nobody named need be of no one class: a coffee machine lies within the box of what stands around it. It is a piece
    where it is a board or a post that would fall by itself (`is_loose_board`).
    """
    whole_of: dict[str, str] = {}
    for piece in entities:
        if piece.movable or piece.node_type == "layout":
            continue
        for whole in entities:
            if len(whole.points) <= len(piece.points) or piece.name in whole_of or whole.node_type == "layout":
                continue
            if piece.class_name == UNNAMED:
                if is_loose_board(piece, whole, entities):
                    whole_of[piece.name] = whole.name
            elif whole.class_name == piece.class_name:
                shared = boxes_overlap_volume(piece.box, whole.box)
                if shared >= PIECE_SHARE * box_volume(piece.box):
                    whole_of[piece.name] = whole.name
    return whole_of


def is_loose_board(piece: Entity, whole: Entity, entities: list[Entity]) -> bool:
    """Whether a thing without a name is a board, a post or a bar that lies in the box of another one, and that would
    fall by itself: it touches nothing that would carry it, and would not even stand if something did."""
    least, most = min(piece.box.size), max(piece.box.size)
    if least > min(BOARD, SLENDER * most) or max(whole.box.size) <= most:
        return False
    if points_in_box(whole.box, piece.points, margin=TOUCH).mean() < PIECE_SHARE:
        return False
    touched = (patch for entity in entities if entity is not piece for patch in carriers_touched(piece, entity))
    if any(hull_overlap(patch.hull, piece.box) >= PART_SHARE for patch in touched):
        return False
    return not stands_steadily([piece.points], piece.bottom)


def carriers_touched(child: Entity, parent: Entity) -> list[Patch]:
    """Return the level patches of an entity that end at the bottom of another one."""
    patches = [parent.patches[k] for k in parent.supporting]
    return [patch for patch in patches if touches(height_gap(child.box, patch))]
