"""Which thing of a map an anchor means, and the anchor of a thing.

Where the anchor says points of the surface and the map what each place of its own is called, a thing fits when it is of
the class, or of none that the masks knew; when most of those points that are called anything are called it; and when
most of it lies in the anchor's box. Else (people write boxes, graphs hold no surface) it fits when its surface passes
the anchor's point, and when its box is much the same (intersection over union of the two boxes, grown so that flat
things have a volume), or lies within the anchor's as the only one of its class: less was seen of it. Where nothing
fits, or two things fit nearly alike, the answer is a conflict in words: a wrong guess would be applied in silence, a
conflict is seen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scenewright.schemas.edits import Anchor
from scenewright.schemas.hand_written import UprightBox
from scenewright.schemas.scene_parts import Box
from scenewright.stages.edit.map_state import MapState, Thing
from scenewright.stages.kit.geometry.boxes import (
    box_corners,
    box_iou,
    box_volume,
    box_yaw,
    boxes_overlap_volume,
    gravity_aligned_box,
    minimum_box,
    points_in_box,
    upright_box,
)
from scipy.spatial import cKDTree

MILLIMETRES = 3
"""Decimals of what is written into edits.toml."""
NAMELESS = "object"
"""The class of things that masks found and did not recognise, or that no mask named: such a thing may be any."""
AROUND = 0.05
"""Surface this near to a point is around it [m]."""
MOST_TRIED = 5000
"""Vertices of a thing that may be an anchor's point."""
SPREAD = 16
"""Points that stand for the surface of a thing."""
MOSTLY_WITHIN = 0.8
"""A box lies in another one by this share of its volume."""


class Conflict(Exception):
    """Why an edit cannot be applied, in words."""


@dataclass(frozen=True)
class Fitting:
    """When a thing is the one that is meant (parameters of `edit map`)."""

    minimum_overlap: float
    minimum_part: float
    margin: float
    """[m]"""
    reach: float
    """[m]"""
    clear_share: float
    minimum_share: float
    minimum_inside: float
    rival_share: float

    def overlap(self, a: Box, b: Box) -> float:
        """Return the intersection over union, 0 to 1, of two upright boxes grown by the margin."""
        return box_iou(self._grown(a), self._grown(b))

    def within(self, inner: Box, outer: Box) -> float:
        """Return the share, 0 to 1, of the first of two upright boxes grown by the margin that lies in the second."""
        small = self._grown(inner)
        return boxes_overlap_volume(small, self._grown(outer)) / box_volume(small)

    def _grown(self, box: Box) -> Box:
        return gravity_aligned_box(box.center, np.asarray(box.size) + 2 * self.margin, box_yaw(box))


class Where(Protocol):
    """What holds things, and may know what the surface at a place is called."""

    def things(self) -> list[Thing]: ...

    def called(self, points: np.ndarray, reach: float) -> np.ndarray | None: ...


def shares(anchor: Anchor, where: Where, fitting: Fitting) -> dict[int, float]:
    """Return instance -> share, 0 to 1, of the anchor's surface that is called so; empty when neither knows any."""
    labels = where.called(np.array(anchor.surface), fitting.reach) if anchor.surface else None
    if labels is None:
        return {}
    numbers, counts = np.unique(labels, return_counts=True)
    return {int(k): float(count) / len(labels) for k, count in zip(numbers, counts, strict=True)}


def find(anchor: Anchor, where: Where, fitting: Fitting, also: Sequence[str] = ()) -> Thing:
    """Return the one thing that fits an anchor, of its class or one of `also`. Raises Conflict."""
    box, classes, candidates = upright_box(anchor.box), (anchor.class_name, *also, NAMELESS), where.things()
    share_of = shares(anchor, where, fitting)
    if share_of:
        return _by_surface(anchor, candidates, share_of, fitting, classes)
    by_overlap = sorted(
        (
            (fitting.overlap(box, candidate.box), candidate)
            for candidate in candidates
            if passes(candidate, anchor, fitting)
        ),
        key=lambda pair: (-pair[0], pair[1].instance),
    )
    good = [(overlap, candidate) for overlap, candidate in by_overlap if overlap >= fitting.minimum_overlap]
    of_class = [(overlap, candidate) for overlap, candidate in good if _may_be(candidate, anchor, classes)]
    if not of_class and not good:
        good = of_class = [pair for pair in by_overlap if _is_part(pair, anchor, candidates, fitting, classes)]
    if not of_class:
        raise Conflict(_why_none(anchor, by_overlap, good))
    rivals = [candidate for overlap, candidate in good if overlap >= fitting.clear_share * of_class[0][0]]
    if len(rivals) > 1:
        two_best = ", ".join(f"{candidate.name} ({overlap:.2f})" for overlap, candidate in good[:2])
        raise Conflict(f"{_place(anchor)} more than one thing fits: {two_best}")
    return of_class[0][1]


def _by_surface(
    anchor: Anchor, candidates: Sequence[Thing], share_of: Mapping[int, float], fitting: Fitting, classes: Sequence[str]
) -> Thing:
    """Return the thing that most of the anchor's surface is called, of those that lie mostly in the anchor's box: what
    a thing stands on or in takes of its fringe, and is none of its size. It must be of its class, and none other have
    a like share. Raises Conflict."""
    box, inside = upright_box(anchor.box), {}
    for candidate in candidates:
        if candidate.instance in share_of:
            assert candidate.surface is not None  # of a map
            inside[candidate.instance] = float(
                points_in_box(box, np.asarray(candidate.surface.data), fitting.margin).mean()
            )
    by_share = sorted(
        ((share_of[candidate.instance], candidate) for candidate in candidates if candidate.instance in share_of),
        key=lambda pair: (-pair[0], pair[1].instance),
    )
    if not by_share:
        raise Conflict(f"{_place(anchor)} lies no thing")
    within = [
        (share, candidate) for share, candidate in by_share if inside[candidate.instance] >= fitting.minimum_inside
    ]
    if not within:
        best = by_share[0][1]
        if not _may_be(best, anchor, classes):
            raise Conflict(f"{_place(anchor)} lies {best.name}, which is no {anchor.class_name}")
        percent_inside = 100 * inside[best.instance]
        raise Conflict(f"{_place(anchor)} lies {best.name}, of which {percent_inside:.0f} % is where it was")
    share, best = within[0]
    nameless = best.class_name == NAMELESS != anchor.class_name
    least = fitting.minimum_share if nameless else fitting.minimum_part  # its name says nothing for it
    if share < least or share < fitting.minimum_share * sum(other_share for other_share, _ in within):
        raise Conflict(f"{_place(anchor)} {best.name} has {100 * share:.0f} % of its surface, and nothing has more")
    if not _may_be(best, anchor, classes):
        raise Conflict(f"{_place(anchor)} lies {best.name}, which is no {anchor.class_name}")
    alike = max(fitting.minimum_overlap, fitting.clear_share * fitting.overlap(box, best.box))
    rivals = {candidate.instance for other_share, candidate in within if other_share >= fitting.rival_share * share}
    for candidate in candidates:
        same = candidate.instance in rivals
        if candidate.instance != best.instance and (same or fitting.overlap(box, candidate.box) >= alike):
            raise Conflict(f"{_place(anchor)} more than one thing fits: {best.name}, {candidate.name}")
    return best


def _may_be(candidate: Thing, anchor: Anchor, classes: Sequence[str]) -> bool:
    return candidate.class_name in classes or anchor.class_name == NAMELESS


def _is_part(
    pair: tuple[float, Thing], anchor: Anchor, candidates: Sequence[Thing], fitting: Fitting, classes: Sequence[str]
) -> bool:
    """Whether a thing is what a map that saw less has of the anchor's, and nothing else could be more of it."""
    (overlap, candidate), box = pair, upright_box(anchor.box)
    if not _may_be(candidate, anchor, classes) or overlap < fitting.minimum_part:
        return False
    inside = [k for k in candidates if _may_be(k, anchor, classes) and fitting.within(k.box, box) >= MOSTLY_WITHIN]
    return [k.instance for k in inside] == [candidate.instance]


def passes(thing: Thing, anchor: Anchor, fitting: Fitting) -> bool:
    """Whether the surface of a thing, or else its box, comes within reach of an anchor's point."""
    if thing.surface is None:
        return bool(points_in_box(thing.box, np.array([anchor.point]), fitting.reach)[0])
    return bool(thing.surface.query(anchor.point, distance_upper_bound=fitting.reach)[0] <= fitting.reach)


def _place(anchor: Anchor) -> str:
    return "at ({:.2f}, {:.2f}, {:.2f}) m".format(*anchor.point)


def _why_none(anchor: Anchor, fits: list[tuple[float, Thing]], good: list[tuple[float, Thing]]) -> str:
    if good:
        return f"{_place(anchor)} lies {good[0][1].name}, which is no {anchor.class_name}"
    if fits:
        overlap, candidate = fits[0]
        return f"{_place(anchor)} lies {candidate.name}, whose box is another one (overlap {overlap:.2f})"
    return f"{_place(anchor)} lies no thing"


def anchor_of(state: MapState, instance: int) -> Anchor:
    """Return the anchor of a thing of a map, rounded to millimetres. Raises KeyError when it has no surface.

    Its point is the vertex with most of the thing's own surface around it and least of others', so that it stays on
    the thing when borders and fringes move.
    """
    anchored = next((anchored for anchored in state.things() if anchored.instance == instance), None)
    if anchored is None:
        raise KeyError(instance)
    assert anchored.surface is not None  # of a map
    points = np.asarray(anchored.surface.data)
    tried = points[:: -(-len(points) // MOST_TRIED)]
    neighbour_count = anchored.surface.query_ball_point(tried, AROUND, return_length=True)
    others = state.surface.vertices[state.instance != instance].astype(float)
    others = others[points_in_box(anchored.box, others, AROUND)]
    if len(others):
        neighbour_count = neighbour_count - cKDTree(others).query_ball_point(tried, AROUND, return_length=True)
    spread = [tried[int(np.argmax(neighbour_count))], *tried[_spread(tried, neighbour_count)]]
    point, *surface = (tuple(round(float(value), MILLIMETRES) for value in chosen_point) for chosen_point in spread)
    fields = {"class": anchored.class_name, "box": written_box(anchored.box), "point": point, "surface": tuple(surface)}
    return Anchor.model_validate(fields)


def _spread(points: np.ndarray, worth: np.ndarray) -> list[int]:
    """Return which of points (N, 3) stand for all of them: the worthiest of each of the SPREAD cells around points that
    lie as far from each other as can be."""
    far = np.linalg.norm(points - points.mean(axis=0), axis=1)
    distance, cell = np.full(len(points), np.inf), np.zeros(len(points), int)
    for number in range(min(SPREAD, len(points))):
        start = int(np.argmax(far if number == 0 else distance))
        nearer = np.linalg.norm(points - points[start], axis=1)
        cell = np.where(nearer < distance, number, cell)
        distance = np.minimum(distance, nearer)
    cells = [np.flatnonzero(cell == number) for number in np.unique(cell)]
    return [int(rows[np.argmax(worth[rows])]) for rows in cells]


def anchor_of_node(node: Thing) -> Anchor:
    """Return the anchor of a node of a graph, which has no surface: its point is the middle of its box."""
    box = written_box(node.box)
    return Anchor.model_validate({"class": node.class_name, "box": box, "point": box.center})


def written_box(box: Box) -> UprightBox:
    """Return an upright box as it is written down, to millimetres and hundredths of a degree."""
    cx, cy, cz = (round(value, MILLIMETRES) for value in box.center)
    sx, sy, sz = (max(round(value, MILLIMETRES), 10.0**-MILLIMETRES) for value in box.size)
    return UprightBox(center=(cx, cy, cz), size=(sx, sy, sz), yaw_degrees=round(math.degrees(box_yaw(box)), 2))


def joint_anchor(anchors: Sequence[Anchor]) -> Anchor:
    """Return the anchor of what the things of several anchors are together; its point is that of the first, its surface
    that of all."""
    corners = np.concatenate([box_corners(upright_box(anchor.box)) for anchor in anchors])
    first = anchors[0]
    return Anchor.model_validate(
        {
            "class": first.class_name,
            "box": written_box(minimum_box(corners)),
            "point": first.point,
            "surface": tuple(point for anchor in anchors for point in anchor.surface)[:64],
        }
    )
