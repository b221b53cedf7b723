"""The scene as a whole: every chosen model on its support and in nothing else (Han 2024, end of section 2.4.4)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from schemas.contact_graph import ContactGraphFile
from schemas.scene_parts import Box, Relation, SurfacePlane
from stages.cad.bearing import shift_to_bearing
from stages.cad.conflicts import Solid, placed_solid
from stages.cad.fitting import shape_at
from stages.cad.free_spots import free_spot
from stages.cad.model_surfaces import ModelSurface, to_world
from stages.cad.placing import placed_box, placed_planes
from stages.cad.settling import Stand, stand_on, tree_order
from stages.cad.shapes import Placement
from stages.kit.geometry.boxes import bottom

SHRINKING = (0.97, 0.94, 0.9)
"""Scales that are tried, as shares of the fitted one, for what is nowhere free."""
FAR = 2.5
"""What is free nowhere near is looked for so many times farther away."""
CLOSING = (0.8, 0.5, 0.0)
"""Joint values that are tried, as shares of the fitted ones."""


@dataclass(frozen=True)
class Arrangement:
    """The scene after adjustment."""

    placements: dict[str, Placement]
    relations: dict[str, Relation]
    """Node -> relation to its parent, with the index of the CAD surface."""


def arrange(
    graph: ContactGraphFile,
    chosen: Mapping[str, Placement],
    alternatives: Mapping[str, Sequence[Placement]],
    surfaces: Mapping[str, ModelSurface],
    obstacles: Mapping[str, Solid],
    *,
    levels: Mapping[str, float],
    area_threshold: float,
    tolerance: float,
    maximum_shift: float,
) -> Arrangement:
    """Return placements that stand on their supports (2.1), one after the other from the root down, large ones first.

    With `maximum_shift` > 0 [m] (ours) each also lies no deeper than `tolerance` [m] in what stands already and in the
    `obstacles` (layout, things that keep their mesh), if there is any way: as it is, moved aside, a little smaller or
    less open, as another of its `alternatives`. What it carries goes along. Min-conflicts exchanges models; neighbours
    that were seen to touch overlap by a centimetre or two whatever the model, and a physics engine throws them apart.
    `levels`: floor node -> height [m] that its slab has in physics.
    """
    placements: dict[str, Placement] = {}
    relations: dict[str, Relation] = {}
    planes: dict[str, tuple[SurfacePlane, ...]] = {}
    went: dict[str, np.ndarray] = {}
    solids: dict[str, Solid] = dict(obstacles)
    for name in _in_order(graph, chosen, surfaces):
        link = graph.parent_link(name)
        parent = None if link is None else link.source
        along = went.get(parent, np.zeros(3)) if parent is not None else np.zeros(3)
        above = planes.get(parent) if parent is not None else None
        if name not in chosen:
            box = graph.node(name).box
            if box is not None:
                stand = stand_on(graph, name, box, above, levels, area_threshold=area_threshold)
                if stand is not None:
                    relations[name] = stand.relation
            elif link is not None:
                relations[name] = link
            continue
        carried = _carried_by(graph, name)
        others = [solid for other, solid in solids.items() if other not in carried]
        best: tuple[float, Placement, Stand | None, Solid] | None = None
        options = list(_options(chosen[name], alternatives.get(name, ()), surfaces, adjust=maximum_shift > 0))
        reaches = [maximum_shift] * len(options) + [FAR * maximum_shift] * (len(options) if maximum_shift > 0 else 0)
        for option, reach in zip(options * 2, reaches, strict=False):
            moved = replace(option, translation=option.translation + along)
            surface = surfaces[moved.shape.model.id]
            box = placed_box(moved, surface)
            stand = stand_on(graph, name, box, above, levels, area_threshold=area_threshold)
            if stand is not None:
                moved = replace(moved, translation=moved.translation + stand.move)
                box = box.model_copy(update={"center": tuple(np.asarray(box.center) + stand.move)})
            if maximum_shift > 0 and parent in placements and stand is not None and stand.outline is not None:
                holder, middle = placements[parent], stand.outline.mean(axis=0)
                aside = shift_to_bearing(holder, surfaces[holder.shape.model.id], box, bottom(box), middle)
                moved = replace(moved, translation=moved.translation + [*aside, 0.0])
                box = box.model_copy(update={"center": tuple(np.asarray(box.center) + [*aside, 0.0])})
            solid, depth = placed_solid(moved, surface), 0.0
            if maximum_shift > 0:
                outline = None if stand is None else stand.outline
                spot = free_spot(
                    solid,
                    others,
                    partial(stays_on, box, outline),
                    tolerance=tolerance,
                    maximum_shift=reach,
                )
                depth, moved = spot.depth, replace(moved, translation=moved.translation + spot.offset)
                solid = solid.shifted(spot.offset)
            if best is None or depth < best[0]:
                best = (depth, moved, stand, solid)
            if depth == 0.0:
                break
        assert best is not None
        _, placement, stand, solids[name] = best
        placements[name] = placement
        planes[name] = placed_planes(placement)
        went[name] = (placement.translation - chosen[name].translation) * [1.0, 1.0, 0.0]
        if stand is not None:
            relations[name] = stand.relation.model_copy(update={"gap": 0.0} if stand.on_top else {})
    return Arrangement(placements, relations)


def _carried_by(graph: ContactGraphFile, name: str) -> set[str]:
    """Return everything that a node carries, and what that carries: it stands on it, or will, once it stands itself."""
    found, waiting = set(), [name]
    while waiting:
        for child in graph.children(waiting.pop()):
            if child not in found:
                found.add(child)
                waiting.append(child)
    return found


def _in_order(
    graph: ContactGraphFile, chosen: Mapping[str, Placement], surfaces: Mapping[str, ModelSurface]
) -> list[str]:
    """Return node ids level by level from the root down; on a level large ones first, as the small give way."""
    order = tree_order(graph)
    level: dict[str, int] = {}
    for name in order:
        link = graph.parent_link(name)
        level[name] = 0 if link is None else level.get(link.source, -1) + 1

    def volume(name: str) -> float:
        if name not in chosen:
            return math.inf
        placement = chosen[name]
        return float(np.prod(placement.scale * placement.shape.size))

    place = {name: k for k, name in enumerate(order)}
    return sorted(order, key=lambda name: (level[name], -volume(name), place[name]))


def _options(
    placement: Placement,
    alternatives: Sequence[Placement],
    surfaces: Mapping[str, ModelSurface],
    *,
    adjust: bool,
) -> Iterator[Placement]:
    """Yield the placement, then what may take its place: smaller, less open, another candidate."""
    yield placement
    if not adjust:
        return
    surface = surfaces[placement.shape.model.id]
    for share in SHRINKING:
        yield about_its_foot(placement, surface, share)
    if any(placement.shape.joints.values()):
        for share in CLOSING:
            joints = {name: share * value for name, value in placement.shape.joints.items()}
            yield replace(placement, shape=shape_at(surface, placement.shape, joints))
    yield from (other for other in alternatives if other is not placement)


def about_its_foot(placement: Placement, surface: ModelSurface, share: float) -> Placement:
    """Return the placement at `share` of its scale, the middle of its foot where it was."""
    points = to_world(placement, surface.hull_points(placement.shape.joints))
    low, high = points.min(axis=0), points.max(axis=0)
    foot = np.array([*(0.5 * (low + high))[:2], low[2]])
    translation = foot + share * (placement.translation - foot)
    return replace(placement, scale=share * placement.scale, translation=translation)


def stays_on(box: Box, outline: np.ndarray | None, shift: np.ndarray) -> bool:
    """Whether the middle of a box that is moved by `shift` (2,) [m] still lies over a surface's outline (4, 2), or as
    much as before; on layout (None) it does."""
    if outline is None or len(outline) < 4:
        return True
    middle = np.asarray(box.center[:2])
    return _outside(outline, middle + shift) <= max(0.0, _outside(outline, middle)) + 1e-9


def _outside(outline: np.ndarray, point: np.ndarray) -> float:
    """Return how far [m] a point (2,) lies outside a rectangle (4, 2); negative inside."""
    center = outline.mean(axis=0)
    distances = []
    for axis in (outline[1] - outline[0], outline[2] - outline[1]):
        length = float(np.linalg.norm(axis))
        if length > 0:
            distances.append(abs(float((point - center) @ axis) / length) - 0.5 * length)
    return max(distances, default=0.0)
