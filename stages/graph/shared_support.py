"""Objects that several others carry at one height: a board over two tables (Han 2024, section 2.6.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scenewright.stages.graph.corrected_support import hull_overlap
from scenewright.stages.graph.nodes import Entity
from scenewright.stages.graph.parameters import GraphParameters
from scenewright.stages.graph.support import Candidate, height_gap, inside_share, stands_inside, support_score
from scenewright.stages.kit.geometry.boxes import clip_polygon, footprint
from scenewright.stages.kit.geometry.planes import plane_height

SAME_LEVEL = 0.02
"""Planes nearer than this in height carry one thing together [m]."""
PART_SHARE = 0.1
"""A carrier among several is over at least this share of the child's footprint."""


@dataclass(frozen=True)
class PartialSupport:
    """A plane that carries a part of an object."""

    parent: str
    patch: int
    gap: float
    share: float
    """Of the child's footprint."""
    height: float


def partial_supports(child: Entity, entities: list[Entity], parameters: GraphParameters) -> list[PartialSupport]:
    """Return of every entity the seen plane just below the child that carries most of it, at least PART_SHARE.

    Layout and what lies around the child (a shelf around a book) carry no part: the floor is under everything.
    """
    best: dict[str, PartialSupport] = {}
    for parent in entities:
        if parent.name == child.name or parent.node_type == "layout":
            continue
        for k in parent.supporting:
            patch = parent.patches[k]
            gap = height_gap(child.box, patch)
            if patch.plane.hidden or not -SAME_LEVEL <= gap <= parameters.maximum_sinking:
                continue
            share = hull_overlap(patch.hull, child.box)
            height = plane_height(patch.plane, np.asarray(child.box.center[:2]))
            if abs(height - parent.top) <= SAME_LEVEL:
                # What lies on a top hides it.
                share = max(share, inside_share(child.box, parent.box))
            if share < PART_SHARE or stands_inside(child, parent, height, container=parent.is_container):
                continue
            if parent.name not in best or share > best[parent.name].share:
                best[parent.name] = PartialSupport(parent.name, k, gap, share, height)
    return list(best.values())


def together_with(main: PartialSupport, parts: list[PartialSupport]) -> list[PartialSupport]:
    """Return the other parts at the height of `main`."""
    return [p for p in parts if p.parent != main.parent and abs(p.height - main.height) <= SAME_LEVEL]


def rests_between(child: Entity, carriers: list[str], entities: list[Entity]) -> bool:
    """Whether the middle of an object lies in the hull of what its footprint shares with those of its carriers."""
    child_footprint = footprint(child.box)
    shared = [clip_polygon(footprint(entity.box), child_footprint) for entity in entities if entity.name in carriers]
    corners = np.concatenate([polygon for polygon in shared if len(polygon)] or [np.zeros((0, 2))])
    if len(corners) < 3:
        return False
    middle = shapely.Point(child.box.center[:2])
    return bool(shapely.MultiPoint(corners).convex_hull.covers(middle))


def shared_candidates(child: Entity, entities: list[Entity], parameters: GraphParameters) -> list[Candidate]:
    """Return relations to carriers of which none reaches b_th (2.2) alone and that do together: a board over two tables
    (Han 2024, section 2.6.5), or between which its middle lies. The one that carries most is the parent; the score
    counts the shares of all."""
    partial = partial_supports(child, entities, parameters)
    result = []
    for main in partial:
        others = together_with(main, partial)
        total = min(1.0, main.share + sum(p.share for p in others))
        if not others or any(p.share > main.share for p in others):
            continue
        if total < parameters.area_threshold:
            # A plank over two stools: little of it is carried, but its middle lies between them.
            if not rests_between(child, [p.parent for p in (main, *others)], entities):
                continue
            total = parameters.area_threshold
        score = support_score(main.gap, total)
        if score >= parameters.minimum_score:
            result.append(
                Candidate(child.name, main.parent, score, "supports", main.gap, main.share, main.height, main.patch)
            )
    return result
