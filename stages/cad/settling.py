"""Put every chosen model exactly onto its support, and move apart what still collides (Han 2024, end of 2.4.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from schemas.contact_graph import SCENE_NODE, ContactGraphFile
from schemas.scene_parts import Box, Relation, SurfacePlane
from stages.cad.conflicts import penetration, placed_solid
from stages.cad.model_surfaces import ModelSurface
from stages.cad.placing import placed_box, placed_planes, supporting_surface, surface_outline
from stages.cad.shapes import Placement
from stages.kit.geometry.boxes import bottom, footprint

ROUNDS = 10
UNEXPLAINED_GAP = 0.05
"""A refined box that ends farther than this from its plane was not put on it by the graph [m]."""
CLEARANCE = 0.001
"""Objects that are moved apart end up this far from each other [m]."""


@dataclass(frozen=True)
class Settled:
    """The scene after adjustment."""

    placements: dict[str, Placement]
    relations: dict[str, Relation]
    """Node -> relation to its parent, with the index of the CAD surface."""


def tree_order(graph: ContactGraphFile) -> list[str]:
    """Return node ids with parents before children, otherwise in the order of the file; without the root."""
    parent = {node.id: (graph.parent_link(node.id) or None) for node in graph.nodes}

    def depth(name: str) -> int:
        steps, link = 0, parent[name]
        while link is not None and steps <= len(parent):
            steps, link = steps + 1, parent.get(link.source)
        return steps

    position = {node.id: k for k, node in enumerate(graph.nodes)}
    names = [node.id for node in graph.nodes if node.id != SCENE_NODE]
    return sorted(names, key=lambda name: (depth(name), position[name]))


def settle(
    graph: ContactGraphFile,
    placements: Mapping[str, Placement],
    surfaces: Mapping[str, ModelSurface],
    *,
    area_threshold: float,
) -> Settled:
    """Return placements for which (2.1) holds exactly, from the root down.

    A child of a CAD model goes on the nearest of its surfaces in which it fits, else on the nearest in height, and
    then sideways until it stands on it. A child of a layout or mesh node goes onto the observed plane. What hangs on a
    wall, and what keeps its mesh, stays where it was seen.
    """
    settled: dict[str, Placement] = dict(placements)
    relations: dict[str, Relation] = {}
    planes: dict[str, tuple[SurfacePlane, ...]] = {}
    for name in tree_order(graph):
        node, link = graph.node(name), graph.parent_link(name)
        own = settled.get(name)
        if link is not None:
            relations[name] = link
            parent_planes = planes.get(link.source)
            box = node.box
            if own is not None:
                box = placed_box(own, surfaces[own.shape.model.id])
            if link.relation in ("supports", "contains") and box is not None and link.source != SCENE_NODE:
                seen_bottom = bottom(node.box) if node.box is not None else bottom(box)
                if parent_planes is not None:
                    index, height, shift = _surface_for(parent_planes, box, seen_bottom, area_threshold)
                elif link.plane is not None:
                    plane = graph.node(link.source).planes[link.plane]
                    index, shift = link.plane, np.zeros(2)
                    height = _height_at(plane, np.asarray(box.center[:2]))
                    if abs(height - seen_bottom) > UNEXPLAINED_GAP:
                        # The graph found nothing that this stands on and named the floor for want of a better.
                        index, height = None, seen_bottom
                else:
                    index, height, shift = None, seen_bottom, np.zeros(2)
                if own is not None:
                    move = np.array([*shift, height - bottom(box)])
                    own = settled[name] = replace(own, translation=own.translation + move)
                    gap = 0.0
                else:
                    gap = bottom(box) - height
                relations[name] = link.model_copy(update={"plane": index, "gap": float(gap)})
        planes_here = placed_planes(own) if own is not None else None
        if planes_here is not None:
            planes[name] = planes_here
    return Settled(settled, relations)


def _height_at(plane: SurfacePlane, ground: np.ndarray) -> float:
    nx, ny, nz = plane.normal
    return -(plane.offset + nx * float(ground[0]) + ny * float(ground[1])) / nz


def _surface_for(
    planes: tuple[SurfacePlane, ...], box: Box, height: float, area_threshold: float
) -> tuple[int | None, float, np.ndarray]:
    """Return (surface index, its height [m], sideways shift (2,)) for a child's box."""
    index = supporting_surface(planes, box, height, area_threshold=area_threshold, tolerance=math.inf)
    if index is not None:
        return index, planes[index].center[2], np.zeros(2)
    level = [k for k, plane in enumerate(planes) if plane.horizontal]
    if not level:
        return None, height, np.zeros(2)
    index = min(level, key=lambda k: (abs(planes[k].center[2] - height), k))
    return index, planes[index].center[2], shift_onto(surface_outline(planes[index]), box)


def shift_onto(outline: np.ndarray, box: Box) -> np.ndarray:
    """Return the least shift (2,) [m] along the sides of a rectangle (4, 2) that brings a footprint inside it.

    A footprint wider than the rectangle is centred on it.
    """
    if len(outline) < 4:
        return np.zeros(2)
    corners = footprint(box)
    shift = np.zeros(2)
    for axis in (outline[1] - outline[0], outline[3] - outline[0]):
        length = float(np.linalg.norm(axis))
        if length <= 0:
            continue
        unit = axis / length
        spots = (corners - outline[0]) @ unit
        low, high = float(spots.min()), float(spots.max())
        if high - low > length:
            shift += unit * (length / 2 - (low + high) / 2)
        elif low < 0:
            shift += unit * -low
        elif high > length:
            shift += unit * (length - high)
    return shift


def separate(
    placements: dict[str, Placement],
    surfaces: Mapping[str, ModelSurface],
    pairs: list[tuple[str, str]],
    frozen: frozenset[str],
    *,
    tolerance: float,
    maximum_shift: float,
) -> dict[str, Placement]:
    """Ours: move colliding models apart sideways, each by at most `maximum_shift` [m]; returns the better scene.

    Min-conflicts can only exchange candidates. Neighbours that were seen to touch often overlap by a centimetre or
    two whatever the candidate, and a physics engine throws them apart. `pairs`: names that must not collide; objects in
    `frozen` (they carry others) do not move.
    """
    current = dict(placements)
    start = {name: placement.translation.copy() for name, placement in placements.items()}
    solids = {name: placed_solid(p, surfaces[p.shape.model.id]) for name, p in current.items()}
    best, best_depth = dict(current), _total(pairs, solids, tolerance)
    for _ in range(ROUNDS):
        moved = False
        for a, b in pairs:
            contact = penetration(solids[a], solids[b])
            if contact.depth <= tolerance:
                continue
            flat = contact.direction * [1.0, 1.0, 0.0]
            length = float(np.linalg.norm(flat))
            if length < 0.5:
                # Deepest from above: part them along the line of their centres instead.
                flat = np.array([*(solids[b].low.mean(axis=0) - solids[a].low.mean(axis=0))[:2], 0.0])
                length = float(np.linalg.norm(flat))
                if length < 1e-6:
                    continue
            step = flat / length * (contact.depth + CLEARANCE)
            movers = [name for name in (a, b) if name not in frozen]
            for name in movers:
                sign = 1.0 if name == b else -1.0
                placement = current[name]
                offset = placement.translation + sign * step / len(movers) - start[name]
                distance = float(np.linalg.norm(offset))
                if distance > maximum_shift:
                    offset *= maximum_shift / distance
                current[name] = replace(placement, translation=start[name] + offset)
                solids[name] = placed_solid(current[name], surfaces[placement.shape.model.id])
                moved = True
        depth = _total(pairs, solids, tolerance)
        if depth < best_depth:
            best, best_depth = dict(current), depth
        if not moved or depth == 0.0:
            break
    return best


def _total(pairs: list[tuple[str, str]], solids: Mapping[str, object], tolerance: float) -> float:
    depths = [penetration(solids[a], solids[b]).depth for a, b in pairs]  # type: ignore[arg-type]
    return float(sum(depth for depth in depths if depth > tolerance))
