"""What bounds the room: floor, ceiling and walls, found by geometry; masks are votes about planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scenewright.stages.fuse.layout.evidence import PARALLEL, Scene, evidence
from scenewright.stages.fuse.layout.planes import CELL, Plane, level_planes, upright_planes

Kind = Literal["floor", "wall", "ceiling"]
FLOOR: Final = "floor"
WALL: Final = "wall"
CEILING: Final = "ceiling"
OPENING = 12
"""Narrower gaps between the columns of a wall belong to it: openings, and what hides it [cells]."""
WITHIN = 0.25
"""Largest distance behind the plane of what belongs to it: reveals, what shines through [m]."""
BEFORE = 0.04
"""Largest distance before the plane of what belongs to it: switches, errors of the map [m]."""
FLAT = 0.06
"""Surface that faces up and lies no higher over the floor is of it [m]."""
FRONT = (BEFORE, 1.0)
"""A plane so far before a wall beside it is more likely the front of what is built into it [m]."""
STOREY, OVER_FLOOR = 1.8, -6.0
"""A level less than this over a floor [m] is a top: log odds."""
IN_FRONT = -1.5
"""Log odds of a plane before a wall."""


@dataclass(frozen=True)
class Judged:
    """A plane with what speaks for its bounding the room and what against."""

    plane: Plane
    kind: Kind
    area: float
    """[m^2]"""
    reasons: dict[str, float]
    """Reason -> log odds."""

    @property
    def log_odds(self) -> float:
        """Over 0 it bounds the room."""
        return sum(self.reasons.values())


@dataclass(frozen=True)
class Layout:
    """The planes that were judged, those that bound the room first, and which of them each vertex is of."""

    planes: tuple[Judged, ...]
    owner: np.ndarray
    """(V,) int32: 1 + number of the plane, 0 none."""
    floor: float | None
    """Height of the floor [m]."""

    def of(self, kind: str) -> np.ndarray:
        """Return which vertices (V,) are of bounds of a kind."""
        numbers = [k for k, each in enumerate(self.planes, 1) if each.kind == kind]
        return np.isin(self.owner, numbers)


def find_layout(scene: Scene) -> Layout:
    """Return what bounds the room. Without a floor the heights of walls are counted from the lowest surface."""
    vertices, normals, areas = scene.vertices, scene.normals, scene.areas
    if not len(vertices):
        return Layout((), np.zeros(0, np.int32), None)
    low, top = np.quantile(vertices[:, 2], [0.002, 0.998])
    ups = _storeys([_judged(p, FLOOR, scene, low, top) for p in level_planes(vertices, normals, areas, up=True)])
    floor = next((float(each.plane.offset) for each in ups if each.log_odds > 0), None)
    base = low if floor is None else floor
    downs = [_judged(p, CEILING, scene, base, top) for p in level_planes(vertices, normals, areas, up=False)]
    walls = [_judged(p, WALL, scene, base, top) for p in upright_planes(vertices, normals, areas)]
    walls = _without_fronts(sorted(walls, key=lambda each: -each.log_odds), scene)
    judged = [*ups, *downs, *walls]
    planes = tuple(sorted(judged, key=lambda each: (each.log_odds <= 0, -each.log_odds)))
    return Layout(planes, _owners(planes, scene), floor)


def _judged(plane: Plane, kind: Kind, scene: Scene, floor: float, top: float) -> Judged:
    return Judged(plane, kind, float(scene.areas[plane.members].sum()), evidence(plane, scene, floor, top))


def _storeys(levels: Sequence[Judged]) -> list[Judged]:
    """Return the levels, the lowest first, with what it means to lie over a floor."""
    result: list[Judged] = []
    for each in sorted(levels, key=lambda each: each.plane.offset):
        over = any(other.log_odds > 0 and each.plane.offset - other.plane.offset < STOREY for other in result)
        reasons = {**each.reasons, "over a floor": OVER_FLOOR} if over else each.reasons
        result.append(replace(each, reasons=reasons))
    return result


def _without_fronts(walls: Sequence[Judged], scene: Scene) -> list[Judged]:
    """Return the walls with what it means to stand before a better one; the best come first."""
    result: list[Judged] = []
    for each in walls:
        before = any(_stands_before(each.plane, other.plane, scene) for other in result if other.log_odds > 0)
        reasons = {**each.reasons, "before a wall": IN_FRONT} if before else each.reasons
        result.append(replace(each, reasons=reasons))
    return result


def _stands_before(plane: Plane, wall: Plane, scene: Scene) -> bool:
    """Whether a plane faces as a wall does, a little before it, and within an opening's width along it."""
    if plane.normal @ wall.normal < PARALLEL:
        return False
    points = scene.vertices[plane.members]
    columns, own = (wall.cells(each)[:, 0] for each in (scene.vertices[wall.members], points))
    gap = float(np.median(wall.distance(points)))
    return bool(
        FRONT[0] < gap < FRONT[1] and own.min() < columns.max() + OPENING and own.max() > columns.min() - OPENING
    )


def _owners(planes: Sequence[Judged], scene: Scene) -> np.ndarray:
    """Return the plane (V,) of every vertex, numbered from 1; the better plane comes first."""
    owner = np.zeros(len(scene.vertices), np.int32)
    bounds = [(number, each) for number, each in enumerate(planes, 1) if each.log_odds > 0]
    for number, each in sorted(bounds, key=lambda row: not row[1].plane.is_level):  # a floor goes up to the wall
        around = np.arange(len(owner)) if each.plane.is_level else scene.around(each.plane, WITHIN)
        around = around[owner[around] == 0]
        vertices = scene.vertices[around]
        distance = each.plane.distance(vertices)
        behind = _depth_of(each, planes, scene)
        of_plane = (distance < BEFORE) & (distance > -behind)
        if each.plane.is_level:
            of_plane |= (np.abs(distance) < FLAT) & (scene.normals[around] @ each.plane.normal > 0.8)
        else:
            of_plane &= np.isin(each.plane.cells(vertices)[:, 0], _columns(each.plane, scene))
        owner[around[of_plane]] = number
    return owner


def _depth_of(each: Judged, planes: Sequence[Judged], scene: Scene) -> float:
    """Return how far behind a bound surface is of it [m]: not through what it parts from another room or storey."""
    others = [other for other in planes if other.log_odds > 0 and other is not each]
    if each.plane.is_level and not any(
        other.kind == each.kind and other.plane.offset < each.plane.offset - WITHIN for other in others
    ):
        return np.inf
    backs = [other.plane for other in others if other.plane.normal @ each.plane.normal < -PARALLEL]
    gaps = [-float(np.median(each.plane.distance(scene.vertices[back.members]))) for back in backs]
    return min([WITHIN, *(gap - BEFORE for gap in gaps if gap > BEFORE)])


def _columns(plane: Plane, scene: Scene) -> np.ndarray:
    """Return the columns in which a wall was seen, with narrow gaps between them and one on both sides."""
    columns = np.unique(plane.cells(scene.vertices[plane.members])[:, 0])
    gaps = zip(columns[:-1], columns[1:], strict=True)
    hidden = [np.arange(a, b) for a, b in gaps if b - a < OPENING]
    span = np.concatenate([columns, *hidden])
    return np.concatenate([span - 1, span, span + 1])


__all__ = ["CEILING", "CELL", "FLOOR", "WALL", "Judged", "Layout", "find_layout"]
