"""Ours: supporting relations that hold although the camera saw less than all, and more than was there."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scenewright.schemas.scene_parts import Box
from scenewright.stages.graph.enclosing import encloses
from scenewright.stages.graph.nodes import SAME_HEIGHT, Entity, level_patch
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
from scenewright.stages.graph.touching import SINKING, hidden_reach, seam_share, smaller_share, touches
from scenewright.stages.kit.geometry.boxes import clip_polygon, footprint, polygon_area, transform_points_to_box
from scenewright.stages.kit.geometry.planes import plane_height

HIDDEN_FACTOR = 0.8
"""A plane that nobody saw is worth less than the same plane seen."""
BURIED_FACTOR = 0.6
"""A hidden plane in the middle of an object (the seat under a pile of clothes) is worth less again."""
SUNK_SHARE = 0.5
"""Most of its height by which a thing may seem to go through the top on which it stands."""
BOARD_FACTOR = 0.8
"""Share of a container that a board, of which a part was seen, is supposed to span."""
FLOOR_FACTOR = 0.9
"""Share of a footprint that counts as floor where no floor was seen."""
MOVABLE_FACTOR = 0.5
"""Furniture on top of a movable thing: possible, and unlikely."""
SINKING_OF_A_TIE = 0.02
"""The highest plane of a tie may be this much above the child's bottom [m]."""
LEDGE_FACTOR = 0.7
"""A level surface labelled wall is a sill, or floor or furniture that was mislabelled: all else equal, the latter."""
HIDDEN_TOP_DISTANCE = 0.15
"""A hidden supporting plane is looked for this close to the top of a box [m]."""
NAMELESS = "object"
"""Class of things that masks found and nobody named."""
HIGHEST_FOOT = 0.5
"""Largest height over furniture of what stands on it [m]: a hood hangs over the hob. Legs on the floor are longer."""
LEAST_SEAM = 0.2
"""Share of its foot along which a plane must be seen to reach up to an object that is hardly over it."""
LOWER_CELL = 0.03
"""Squares of a footprint in which something lower was seen, or not: a voxel of a coarse map and a half [m]."""
LEAST_SMALLER_SHARE = 0.4
"""Share of the smaller footprint that must lie in the other where an object lies on something narrower than itself."""


def hull_overlap(hull: np.ndarray, child: Box) -> float:
    """Equation 2.2 with the hull (M, 2) of the plane's inliers instead of a rectangle.

    A thing hides the surface that it stands on: below it and in the camera's shadow behind it the parent has no
    vertices, so the thesis's rectangle covers a strip in front of it. The hull of the whole plane spans the hole; it
    is also not stretched by two stray vertices.
    """
    area = polygon_area(footprint(child))
    if len(hull) < 3 or area <= 0.0:
        return 0.0
    return float(min(1.0, max(0.0, polygon_area(clip_polygon(hull, footprint(child)))) / area))


def candidates_for(child: Entity, entities: list[Entity], parameters: GraphParameters) -> list[Candidate]:
    """Return every acceptable supporting relation of one object, best first (section 2.2.2, corrected).

    A relation is acceptable when (2.1) and (2.2) hold within a_th and b_th and the score (2.3) reaches
    `minimum_score`; contact and height then decide among those that score alike.
    """
    candidates: list[Candidate] = []
    for parent in possible_parents(child, entities):
        seen_candidates = [seen_candidate(child, parent, k, parameters) for k in parent.supporting]
        accepted = [candidate for candidate in seen_candidates if candidate is not None]
        candidates += accepted
        # A shelf shows its boards to a camera that is too low to see its top, on which the child stands.
        close = [candidate for candidate in accepted if abs(candidate.gap) <= HIDDEN_TOP_DISTANCE]
        if not close and parent.node_type != "layout":
            hidden = continued_candidate(child, parent, entities, parameters)
            hidden = hidden or hidden_candidate(child, parent, parameters)
            if hidden is not None:
                candidates.append(hidden)
    return prefer_contact(prefer_the_highest(best_first(candidates, entities), parameters))


def holds(parent: Entity, child: Entity) -> bool:
    """Whether things are in the parent rather than on it: by its class; of what nobody named, by its surface."""
    return parent.is_container or (parent.class_name == NAMELESS and encloses(parent, child))


def seen_candidate(child: Entity, parent: Entity, k: int, parameters: GraphParameters) -> Candidate | None:
    """Return the relation over the parent's patch `k`, or None."""
    patch = parent.patches[k]
    height = plane_height(patch.plane, np.asarray(child.box.center[:2]))
    gap = height_gap(child.box, patch)
    # A plane through the child's body does not carry it: without this, what is left of a chair pushed under a table
    # (its back) would hang on the table top.
    if gap < deepest_gap(child, parent, parameters):
        return None
    if child.class_name in parameters.wall_classes and gap > parameters.floating_gap:
        return None
    # Legs are missed, so furniture may seem to float; a cup or a keyboard does not lose its lower half metre.
    if child.movable and gap > parameters.movable_gap:
        return None
    if parent.class_name != "floor" and gap > HIGHEST_FOOT:
        return None
    inside = stands_inside(child, parent, height, container=holds(parent, child))
    least = parameters.area_threshold
    overlap = effective = hull_overlap(patch.hull, child.box)
    if parent.class_name == "floor":
        # The floor goes on under furniture and outside the camera's view.
        effective = max(overlap, FLOOR_FACTOR)
    elif inside:
        # A board spans its container, though the camera saw the front edge only.
        effective = max(overlap, BOARD_FACTOR * inside_share(child.box, parent.box))
    touching = touches(gap)
    if touching and effective < least and parent.node_type != "layout":
        seam = seam_share(child, patch)
        if seam >= LEAST_SEAM:
            effective, least = max(effective, HIDDEN_FACTOR * seam), 0.0
    if effective < least:
        return None
    score = support_score(gap, effective)
    if parent.movable and not child.movable:
        score *= MOVABLE_FACTOR
    if parent.node_type == "layout" and parent.class_name != "floor":
        score *= LEDGE_FACTOR
    if gap < -parameters.maximum_sinking:
        score *= BURIED_FACTOR
    if score < parameters.minimum_score:
        return None
    relation: Literal["supports", "contains"] = "contains" if inside else "supports"
    return Candidate(child.name, parent.name, score, relation, gap, overlap, height, k, touching=touching)


def deepest_gap(child: Entity, parent: Entity, parameters: GraphParameters) -> float:
    """Return the least gap [m], negative, at which a top of the parent may still carry the child.

    Below a top of dark stone or gloss a camera sees mirrored and scattered depth: what nobody named may seem to begin
    below the top on which it stands, as long as most of it is above.
    """
    sinking = parameters.maximum_sinking
    if child.class_name == NAMELESS and parent.node_type != "layout" and not parent.movable:
        sinking = max(sinking, SUNK_SHARE * (child.top - child.bottom))
    return -sinking


def hidden_candidate(child: Entity, parent: Entity, parameters: GraphParameters) -> Candidate | None:
    """Return the relation over a supporting plane that nobody saw, or None.

    The thesis puts no limit on where such a plane may lie; we want it near the parent's top, or inside a container, or
    (worth less) within a parent that shows no horizontal plane at all.
    """
    share = inside_share(child.box, parent.box)
    over_top = child.bottom - parent.top
    touching = False
    if child.top > parent.top:
        touching = touches(over_top)
        if share < parameters.area_threshold and smaller_share(child.box, parent.box) >= LEAST_SMALLER_SHARE:
            if child.movable or child.class_name == NAMELESS:
                touching = -SINKING <= over_top <= min(HIDDEN_TOP_DISTANCE, hidden_reach(child.box, parent.box))
            if touching:
                share = max(parameters.area_threshold, HIDDEN_FACTOR * smaller_share(child.box, parent.box))
    if share < parameters.area_threshold:
        return None
    outline = clip_polygon(footprint(parent.box), footprint(child.box))
    if len(outline) < 3:
        return None
    height = child.bottom
    inside = (
        stands_inside(child, parent, height, container=holds(parent, child))
        and height >= parent.bottom - ORDER_TOLERANCE
    )
    if child.class_name in parameters.wall_classes and not inside:
        return None
    if inside:
        score = HIDDEN_FACTOR * share
    elif abs(over_top) <= HIDDEN_TOP_DISTANCE and child.top > parent.top:
        score = HIDDEN_FACTOR * support_score(over_top, share)
    elif not parent.supporting and parent.bottom < height < parent.top:
        score = BURIED_FACTOR * share
    else:
        return None
    if parent.movable and not child.movable:
        score *= MOVABLE_FACTOR
    if score < parameters.minimum_score:
        return None
    relation: Literal["supports", "contains"] = "contains" if inside else "supports"
    patch = level_patch(outline, height, hidden=True)
    return Candidate(child.name, parent.name, score, relation, 0.0, share, height, None, patch, touching)


def continued_candidate(
    child: Entity, parent: Entity, entities: list[Entity], parameters: GraphParameters
) -> Candidate | None:
    """Return the relation over the largest seen top at the child's bottom, where that top goes on, or None.

    A worktop of dark stone shows a depth camera its edge alone, and what stands farther back on it seems to hang on the
    wall behind. Where a top does end, a camera above it sees what is lower. So the top goes on within the parent's box
    where nothing lower was seen: in `area_threshold` of the child's footprint at least.
    """
    tops, deepest = [], deepest_gap(child, parent, parameters)
    for patch in (parent.patches[k] for k in parent.supporting):
        gap = height_gap(child.box, patch)
        if not patch.plane.hidden and deepest <= gap <= HIDDEN_TOP_DISTANCE:
            tops.append((patch.plane.area, gap))
    if not tops or child.class_name in parameters.wall_classes:
        return None
    area, gap = max(tops)
    outline = clip_polygon(footprint(parent.box), footprint(child.box))
    if area < polygon_area(footprint(child.box)) or len(outline) < 3:
        return None
    height = child.bottom - gap
    share = inside_share(child.box, parent.box) - seen_lower(child, height, entities)
    score = HIDDEN_FACTOR * support_score(gap, share) * (BURIED_FACTOR if gap < -parameters.maximum_sinking else 1.0)
    if share < parameters.area_threshold or score < parameters.minimum_score:
        return None
    patch = level_patch(outline, height, hidden=True)
    return Candidate(child.name, parent.name, score, "supports", gap, share, height, None, patch)


def seen_lower(child: Entity, height: float, entities: list[Entity]) -> float:
    """Return the share of the child's footprint in which a surface that is not its own was seen below `height` [m]."""
    box = child.box
    cells = np.zeros(np.maximum(1, np.round(np.array(box.size[:2]) / LOWER_CELL)).astype(int), bool)
    for entity in entities:
        if entity.name != child.name and len(entity.points):
            points = entity.points[entity.points[:, 2] < height - SAME_HEIGHT]
            cell_position = transform_points_to_box(box, points)[:, :2] / box.size[:2] + 0.5
            cell_position = cell_position[((cell_position >= 0) & (cell_position < 1)).all(axis=1)]
            cells[tuple((cell_position * cells.shape).astype(int).T)] = True
    return float(cells.mean())


def prefer_contact(ranked: list[Candidate]) -> list[Candidate]:
    """Put the best relation in contact before one to a plane that lies deeper: nothing floats over what it touches.

    Legs that a map misses make furniture float, but not onto something that ends just where the seat begins.
    """
    best = next((candidate for candidate in ranked if candidate.touching), None)
    if best is None or best.height <= ranked[0].height:
        return ranked
    return [best, *(candidate for candidate in ranked if candidate is not best)]


def prefer_the_highest(ranked: list[Candidate], parameters: GraphParameters) -> list[Candidate]:
    """Among relations whose scores are within `tie_margin` of the best put the highest plane first.

    Things fall onto the first surface below them. (2.3) measures the gap in metres, so the table 3 cm below the book
    that a cup stands on costs 0.03 only, less than the rim of the cup that sticks out over the book.
    """
    if not ranked:
        return []
    best = ranked[0].score
    tied = [c for c in ranked if c.score >= best - parameters.tie_margin and c.gap >= -SINKING_OF_A_TIE]
    if not tied:
        return ranked
    first = max(tied, key=lambda c: (round(c.height, 6), c.score))
    return [first, *(c for c in ranked if c is not first)]
