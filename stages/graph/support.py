"""How well one plane supports one object: equations 2.1 to 2.3 of Han 2024, and candidate relations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from schemas.scene_parts import Box
from stages.graph.nodes import Entity, Patch, level_patch, plane_height
from stages.graph.parameters import GraphParameters
from stages.graph.touching import SINKING, hidden_reach, seam_share, smaller_share, touches
from stages.kit.geometry.boxes import (
    bottom,
    clip_polygon,
    footprint,
    footprint_overlap,
    polygon_area,
    transform_points_to_box,
)

INSIDE_SHARE = 0.7
"""A child is inside a container when this share of its footprint is within the container's."""
ORDER_TOLERANCE = 0.03
"""How much lower than its support a child's box may reach, as heights of fused surfaces are off by this [m]."""
HIDDEN_FACTOR = 0.8
"""A plane that nobody saw is worth less than the same plane seen."""
BURIED_FACTOR = 0.6
"""A hidden plane in the middle of an object (the seat under a pile of clothes) is worth less again."""
BOARD_FACTOR = 0.8
"""Share of a container that a board, of which a part was seen, is supposed to span."""
FLOOR_FACTOR = 0.9
"""Share of a footprint that counts as floor where no floor was seen."""
MOVABLE_FACTOR = 0.5
"""Furniture on top of a movable thing: possible, and unlikely."""
SAME_TOP = 0.01
"""Tops and planes nearer than this are at the same height [m]."""
SINKING_OF_A_TIE = 0.02
"""The highest plane of a tie may be this much above the child's bottom [m]."""
LEDGE_FACTOR = 0.7
"""A level surface labelled wall is a sill, or floor or furniture that was mislabelled: all else equal, the latter."""
HIDDEN_TOP_DISTANCE = 0.15
"""A hidden supporting plane is looked for this close to the top of a box [m]."""
NAMELESS = "object"
"""Class of things that masks found and nobody named."""
LEAST_SEAM = 0.2
"""Share of its foot along which a plane must be seen to reach up to an object that is hardly over it."""
LEAST_SMALLER_SHARE = 0.4
"""Share of the smaller footprint that must lie in the other where an object lies on something narrower than itself."""


@dataclass(frozen=True)
class Candidate:
    """One way in which `child` may hang in the tree."""

    child: str
    parent: str
    score: float
    relation: Literal["supports", "contains", "carries_on_wall", "hangs_from"]
    gap: float
    """Signed height D of the child's bottom over the plane [m] (2.1)."""
    overlap: float
    """A(v_p, v_c) as measured (2.2)."""
    height: float
    """Of the plane under the child [m]."""
    patch: int | None
    """Index into the parent's patches; None when the plane is hidden and must be registered."""
    hidden: Patch | None = None
    touching: bool = False
    """Whether the plane is seen in contact with the child's bottom (stages/graph/touching.py)."""


def height_gap(child: Box, patch: Patch) -> float:
    """Equation 2.1: D(v_c, pi) = p_c - (-d + s_c / 2), the signed height of the child's bottom over the plane [m]."""
    return bottom(child) - plane_height(patch.plane, np.asarray(child.center[:2]))


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


def support_score(gap: float, overlap: float) -> float:
    """Equation 2.3: {1 - min[1, |D|]} * A, with D in metres."""
    return (1.0 - min(1.0, abs(gap))) * overlap


def inside_share(child: Box, container: Box) -> float:
    """Return the share of the child's footprint that lies within the container's."""
    area = float(child.size[0] * child.size[1])
    return footprint_overlap(child, container) / area if area > 0.0 else 0.0


def stands_inside(child: Entity, parent: Entity, height: float) -> bool:
    """Whether the child stands within a container: on an inner plane at `height`, top below the container's top."""
    return (
        parent.is_container
        and child.top <= parent.top + SAME_TOP
        and height < parent.top - SAME_TOP
        and inside_share(child.box, parent.box) >= INSIDE_SHARE
    )


def candidates_for(child: Entity, entities: list[Entity], parameters: GraphParameters) -> list[Candidate]:
    """Return every acceptable supporting relation of one object, best first (section 2.2.2).

    Candidate parents are all nodes whose bottom is below the child's; a relation is acceptable when (2.1) and (2.2)
    hold within a_th and b_th and the score (2.3) reaches `minimum_score`. Ties fall to the smaller instance label.
    """
    ours = parameters.method == "ours"
    found: list[Candidate] = []
    for parent in entities:
        if parent.name == child.name or parent.class_name == "ceiling":
            continue
        if not parent.bottom < child.bottom + ORDER_TOLERANCE:
            continue
        seen = [_seen(child, parent, k, parameters) for k in parent.supporting]
        accepted = [candidate for candidate in seen if candidate is not None]
        found += accepted
        # A shelf shows its boards to a camera that is too low to see its top, on which the child stands.
        close = [c for c in accepted if abs(c.gap) <= HIDDEN_TOP_DISTANCE]
        if not (close if ours else accepted) and parent.node_type != "layout":
            hidden = hidden_candidate(child, parent, parameters)
            if hidden is not None:
                found.append(hidden)
    order = {entity.name: entity.instance for entity in entities}
    found.sort(key=lambda c: (-c.score, order[c.parent], -1 if c.patch is None else c.patch))
    return prefer_contact(prefer_the_highest(found, parameters)) if ours else found


def _seen(child: Entity, parent: Entity, k: int, parameters: GraphParameters) -> Candidate | None:
    patch = parent.patches[k]
    height = plane_height(patch.plane, np.asarray(child.box.center[:2]))
    gap = height_gap(child.box, patch)
    inside = stands_inside(child, parent, height)
    touching, least = False, parameters.area_threshold
    if parameters.method == "thesis":
        overlap = effective = rectangle_overlap(patch.points, child.box)
    else:
        # A plane through the child's body does not carry it: without this, what is left of a chair pushed under a
        # table (its back) would hang on the table top.
        if gap < -parameters.maximum_sinking:
            return None
        if child.class_name in parameters.wall_classes and gap > parameters.floating_gap:
            return None
        # Legs are missed, so furniture may seem to float; a cup or a keyboard does not lose its lower half metre.
        if child.movable and gap > parameters.movable_gap:
            return None
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
    if parameters.method == "ours" and parent.movable and not child.movable:
        score *= MOVABLE_FACTOR
    if parameters.method == "ours" and parent.node_type == "layout" and parent.class_name != "floor":
        score *= LEDGE_FACTOR
    if score < parameters.minimum_score:
        return None
    relation: Literal["supports", "contains"] = "contains" if inside else "supports"
    return Candidate(child.name, parent.name, score, relation, gap, overlap, height, k, touching=touching)


def hidden_candidate(child: Entity, parent: Entity, parameters: GraphParameters) -> Candidate | None:
    """Return the relation over a supporting plane that nobody saw, or None.

    "When v_c is well-overlapped with v_i but v_i has no valid supporting plane, the bottom plane of v_c will be
    registered as a new supporting plane of v_i" (section 2.2.2). The thesis puts no limit on where; we want the plane
    near the parent's top, or inside a container, or (worth less) within a parent that shows no horizontal plane at all.
    """
    share = inside_share(child.box, parent.box)
    over_top = child.bottom - parent.top
    touching = False
    if parameters.method == "ours" and child.top > parent.top:
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
    patch = level_patch(outline, height, hidden=True)
    inside = stands_inside(child, parent, height) and height >= parent.bottom - ORDER_TOLERANCE
    if parameters.method == "thesis":
        if parent.supporting:
            return None
        score = support_score(0.0, share)
    else:
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
    return Candidate(child.name, parent.name, score, relation, 0.0, share, height, None, patch, touching)


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
