"""Register hidden planes, extend boxes down to what supports them, find proximal pairs (Han 2024, section 2.2.2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenewright.schemas.scene_parts import Box, Relation
from scenewright.stages.graph.evidence import Surfaces, shared_middle
from scenewright.stages.graph.nodes import SAME_HEIGHT, Entity
from scenewright.stages.graph.support import Candidate
from scenewright.stages.kit.geometry.boxes import box_volume, boxes_overlap_volume, minimum_box

LEAST_SHARED_VOLUME = 1e-6
"""Boxes that merely touch share less than this by rounding [m^3]."""
SLAB_THICKNESS = 0.04
"""Thickness that a wall's plane gets for the intersection test [m]."""


def register_hidden_planes(
    entities: dict[str, Entity], chosen: dict[str, Candidate]
) -> tuple[dict[str, Entity], dict[str, Candidate]]:
    """Add hidden supporting planes to their parents, and point the relations at them.

    Children at the same height (2 cm) share one hidden plane.
    """
    entities = dict(entities)
    linked: dict[str, Candidate] = {}
    for name in sorted(chosen):
        candidate = chosen[name]
        if candidate.hidden is not None:
            parent = entities[candidate.parent]
            index = next(
                (
                    k
                    for k in parent.supporting
                    if parent.patches[k].plane.hidden
                    and abs(parent.patches[k].plane.center[2] - candidate.height) < SAME_HEIGHT
                ),
                None,
            )
            if index is None:
                index = len(parent.patches)
                entities[candidate.parent] = parent.with_patch(candidate.hidden)
            height = entities[candidate.parent].patches[index].plane.center[2]
            gap = entities[name].bottom - height
            candidate = replace(candidate, patch=index, hidden=None, height=height, gap=gap)
        linked[name] = candidate
    return entities, linked


def wall_slabs(entity: Entity) -> list[tuple[int | None, Box]]:
    """Return thin boxes around the planes of a layout entity, with the index of the plane.

    One wall entity may hold all four walls of a room, whose common box would meet everything in it.
    """
    slabs: list[tuple[int | None, Box]] = []
    for k, patch in enumerate(entity.patches):
        corners = np.asarray(patch.plane.corners)
        if len(corners) == 4:
            normal = np.asarray(patch.plane.normal)
            slabs.append((k, minimum_box(np.concatenate([corners, corners - SLAB_THICKNESS * normal]))))
    return slabs or [(None, entity.box)]


def proximal_relations(entities: list[Entity], boxes: dict[str, Box], linked: set[tuple[str, str]]) -> list[Relation]:
    """Return undirected proximal relations: Vol(B_1 n B_2) > 0 and neither carries the other (section 2.2.1).

    `boxes`: refined boxes by name; `linked`: (parent, child) pairs. Layout nodes take part with the slabs of their
    planes; two layout nodes do not. The confidence is the shared volume as a share of the smaller box.
    """
    solids = {e.name: (wall_slabs(e) if e.node_type == "layout" else [(None, boxes[e.name])]) for e in entities}
    surfaces = Surfaces()
    relations = []
    for k, a in enumerate(entities):
        for b in entities[k + 1 :]:
            if a.node_type == "layout" and b.node_type == "layout":
                continue
            if (a.name, b.name) in linked or (b.name, a.name) in linked:
                continue
            shared, plane, pair = 0.0, None, (boxes[a.name], boxes[b.name])
            for first_plane, first in solids[a.name]:
                for second_plane, second in solids[b.name]:
                    volume = boxes_overlap_volume(first, second)
                    if volume > shared:
                        shared, pair = volume, (first, second)
                        plane = first_plane if first_plane is not None else second_plane
            if shared <= LEAST_SHARED_VOLUME:
                continue
            smaller = min(box_volume(pair[0]), box_volume(pair[1]))
            share = float(min(1.0, shared / smaller)) if smaller > 0 else 1.0
            # A layout entity comes first, so that `plane` counts the planes of the source.
            source, target = (b, a) if b.node_type == "layout" else (a, b)
            relations.append(
                Relation(
                    source=source.name,
                    target=target.name,
                    relation="proximal",
                    confidence=share,
                    plane=plane,
                    gap=surfaces.distance(a, b),
                    overlap=share,
                    contact=shared_middle(*pair),
                )
            )
    return relations
