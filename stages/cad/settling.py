"""Where things have to be to stand exactly on their supports (Han 2024, end of 2.4.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.scene_parts import Box, Relation, SurfacePlane
from scenewright.stages.cad.placing import supporting_surface, surface_outline, surface_share
from scenewright.stages.kit.geometry.boxes import bottom, footprint

WELL_CARRIED = 0.85
"""Least share of its footprint with which a thing stays where it stands; with less it is moved onto the surface."""


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


@dataclass(frozen=True)
class Stand:
    """Where one thing stands: how it has to move, and the relation that says on what."""

    move: np.ndarray
    """(3,) [m] that brings the placement onto its support."""
    relation: Relation
    on_top: bool = False
    """Whether it stands on something, other than the scene's root, rather than hanging."""
    outline: np.ndarray | None = None
    """(4, 2) of the carrying surface of a CAD model, None on layout and meshes."""


def stand_on(
    graph: ContactGraphFile,
    name: str,
    box: Box,
    parent_planes: tuple[SurfacePlane, ...] | None,
    levels: Mapping[str, float],
    *,
    area_threshold: float,
    rise: float = 0.0,
) -> Stand | None:
    """Return how a node with (placed) `box` comes to satisfy (2.1) on its parent, None for what has no parent.

    `parent_planes`: those of the parent's placed CAD model, None when the parent has none. A child of a CAD model goes
    on the nearest of its surfaces in which it fits, else on the nearest in height, and then sideways until it stands on
    it. A child of a layout or mesh node goes onto the observed plane; of a floor that is level in physics, onto its
    height (`levels`: floor node -> [m]). `rise`: how far a parent that keeps its mesh was raised [m]. What hangs stays
    where it was seen.
    """
    node, link = graph.node(name), graph.parent_link(name)
    if link is None:
        return None
    if link.relation not in ("supports", "contains") or link.source == SCENE_NODE:
        return Stand(np.zeros(3), link)
    seen_bottom = bottom(node.box) + rise if node.box is not None else bottom(box)
    shift, outline = np.zeros(2), None
    if parent_planes is not None:
        index, height, shift = _surface_for(parent_planes, box, seen_bottom, area_threshold)
        if index is not None:
            outline = surface_outline(parent_planes[index])
    elif link.plane is not None:
        plane = graph.node(link.source).planes[link.plane]
        index, height = link.plane, levels.get(link.source, _height_at(plane, np.asarray(box.center[:2])) + rise)
    else:
        index, height = None, seen_bottom
    relation = link.model_copy(update={"plane": index, "gap": float(bottom(box) - height)})
    return Stand(np.array([*shift, height - bottom(box)]), relation, on_top=True, outline=outline)


def _height_at(plane: SurfacePlane, ground: np.ndarray) -> float:
    nx, ny, nz = plane.normal
    return -(plane.offset + nx * float(ground[0]) + ny * float(ground[1])) / nz


def _surface_for(
    planes: tuple[SurfacePlane, ...], box: Box, height: float, area_threshold: float
) -> tuple[int | None, float, np.ndarray]:
    """Return (surface index, its height [m], sideways shift (2,)) for a child's box."""
    index = supporting_surface(planes, box, height, area_threshold=area_threshold, tolerance=math.inf)
    if index is not None:
        # On the model's surface (2.2) may hold where the thing would tip over the edge: models are not quite the real
        # furniture.
        share = surface_share(planes[index], box)
        shift = np.zeros(2) if share >= WELL_CARRIED else shift_onto(surface_outline(planes[index]), box)
        return index, planes[index].center[2], shift
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
