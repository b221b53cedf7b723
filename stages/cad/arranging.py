"""The scene as a whole: every chosen model on its support (Han 2024, end of section 2.4.4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import Box, Relation, SurfacePlane
from scenewright.stages.cad.conflicts import placed_solid
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.placing import placed_box, placed_planes
from scenewright.stages.cad.settling import Stand, stand_on, tree_order
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.kit.geometry.convex_solids import Solid


@dataclass(frozen=True)
class Arrangement:
    """The scene after adjustment."""

    placements: dict[str, Placement]
    relations: dict[str, Relation]
    """Node -> relation to its parent, with the index of the CAD surface."""
    shifts: dict[str, np.ndarray]
    """Node that keeps its mesh -> how far (3,) it went [m]."""


@dataclass(frozen=True)
class Seat:
    """Where a node is to stand."""

    name: str
    graph: ContactGraphFile
    parent: Placement | None
    """Of the model that carries it, if one does."""
    planes: tuple[SurfacePlane, ...] | None
    """Of that model, world."""
    along: np.ndarray
    """(3,) how far its parent went [m]."""
    levels: Mapping[str, float]
    """Floor node -> height [m] that its slab has in physics."""
    area_threshold: float
    """b_th."""

    def stand(self, box: Box) -> Stand | None:
        """Return how a box stands here."""
        return stand_on(
            self.graph, self.name, box, self.planes, self.levels, area_threshold=self.area_threshold, rise=self.along[2]
        )

    def standing(self, placement: Placement, surface: ModelSurface) -> tuple[Placement, Box, Stand | None]:
        """Return the placement, moved along and onto its support, its box, and how it stands."""
        moved = replace(placement, translation=placement.translation + self.along)
        box = placed_box(moved, surface)
        stand = self.stand(box)
        if stand is not None:
            moved = replace(moved, translation=moved.translation + stand.move)
            box = shifted_box(box, stand.move)
        return moved, box, stand


@dataclass(frozen=True)
class Placed:
    """A model in the scene."""

    placement: Placement
    stand: Stand | None
    solid: Solid


class Placer(Protocol):
    """Puts one thing into the scene."""

    def place(self, placement: Placement, seat: Seat, others: Sequence[Solid]) -> Placed:
        """Return where a chosen model goes. `others`: what stands already and is not carried by it."""
        ...

    def shift(self, box: Box, seat: Seat, solid: Solid, others: Sequence[Solid]) -> np.ndarray:
        """Return how far (3,) [m] a thing goes that keeps its mesh, of which `solid` is the shape in physics."""
        ...


@dataclass(frozen=True)
class Standing:
    """Every model stands on its support, whatever it meets there."""

    surfaces: Mapping[str, ModelSurface]

    def place(self, placement: Placement, seat: Seat, others: Sequence[Solid]) -> Placed:
        """Return it on its support."""
        surface = self.surfaces[placement.shape.model.id]
        moved, _, stand = seat.standing(placement, surface)
        return Placed(moved, stand, placed_solid(moved, surface))

    def shift(self, box: Box, seat: Seat, solid: Solid, others: Sequence[Solid]) -> np.ndarray:
        """Leave it where it was seen."""
        return np.zeros(3)


def arrange(
    graph: ContactGraphFile,
    chosen: Mapping[str, Placement],
    placer: Placer,
    obstacles: Mapping[str, Solid],
    *,
    levels: Mapping[str, float],
    area_threshold: float,
) -> Arrangement:
    """Return placements that stand on their supports (2.1), one after the other from the root down, on a level what
    keeps its mesh first, and large ones before small.

    `obstacles`: layout, and things that keep their mesh. `levels`: floor node -> height [m] that its slab has in
    physics. What a thing carries goes along with it.
    """
    placements: dict[str, Placement] = {}
    relations: dict[str, Relation] = {}
    shifts: dict[str, np.ndarray] = {}
    planes: dict[str, tuple[SurfacePlane, ...]] = {}
    went: dict[str, np.ndarray] = {}
    solids: dict[str, Solid] = dict(obstacles)
    waiting = {name for name in obstacles if graph.node(name).node_type != "layout"}
    for name in _in_order(graph, chosen):
        link = graph.parent_link(name)
        parent = "" if link is None else link.source
        seat = Seat(
            name,
            graph,
            placements.get(parent),
            planes.get(parent),
            went.get(parent, np.zeros(3)),
            levels,
            area_threshold,
        )
        carried = _carried_by(graph, name)
        if name not in chosen:
            box = graph.node(name).box
            if box is not None and name in waiting:
                others = [solid for other, solid in solids.items() if other not in carried | waiting]
                waiting.remove(name)
                went[name] = shifts[name] = placer.shift(box, seat, solids[name], others)
                solids[name] = solids[name].shifted(shifts[name])
                box = shifted_box(box, shifts[name])
            if box is not None:
                stand = seat.stand(box)
                if stand is not None:
                    relations[name] = stand.relation
            elif link is not None:
                relations[name] = link
            continue
        others = [solid for other, solid in solids.items() if other not in carried | waiting]
        placed = placer.place(chosen[name], seat, others)
        solids[name] = placed.solid
        placements[name] = placed.placement
        planes[name] = placed_planes(placed.placement)
        went[name] = (placed.placement.translation - chosen[name].translation) * [1.0, 1.0, 0.0]
        if placed.stand is not None:
            relations[name] = placed.stand.relation.model_copy(update={"gap": 0.0} if placed.stand.on_top else {})
    return Arrangement(placements, relations, shifts)


def shifted_box(box: Box, shift: np.ndarray) -> Box:
    """Return a box that went by `shift` (3,) [m]."""
    return box.model_copy(update={"center": tuple(np.asarray(box.center) + shift)})


def _carried_by(graph: ContactGraphFile, name: str) -> set[str]:
    """Return everything that a node carries, and what that carries: it stands on it, or will, once it stands itself."""
    above, waiting = set(), [name]
    while waiting:
        for child in graph.children(waiting.pop()):
            if child not in above:
                above.add(child)
                waiting.append(child)
    return above


def _in_order(graph: ContactGraphFile, chosen: Mapping[str, Placement]) -> list[str]:
    """Return node ids level by level from the root down; on a level what keeps its mesh first, and large ones before
    small, which give way."""
    order = tree_order(graph)
    level: dict[str, int] = {}
    for name in order:
        link = graph.parent_link(name)
        level[name] = 0 if link is None else level.get(link.source, -1) + 1

    def volume(name: str) -> float:
        if name in chosen:
            return float(np.prod(chosen[name].scale * chosen[name].shape.size))
        box = graph.node(name).box
        return math.inf if box is None else float(np.prod(box.size))

    rank = {name: k for k, name in enumerate(order)}
    return sorted(order, key=lambda name: (level[name], -volume(name), rank[name]))
