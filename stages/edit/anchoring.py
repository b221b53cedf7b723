"""Which thing of a map an anchor means, and the anchor of a thing.

A thing fits when it is of the class, its box is much the same (intersection over union of the two boxes, grown so that
flat things have a volume), and its surface passes the anchor's point. Where nothing fits, or two fit nearly alike, the
answer is a conflict in words: a wrong guess would be applied in silence, a conflict is seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from schemas.edits import Anchor
from schemas.hand_written import UprightBox
from schemas.scene_parts import Box
from stages.edit.map_state import MapState, Thing
from stages.kit.geometry.boxes import box_corners, box_iou, box_yaw, gravity_aligned_box, minimum_box, upright_box

MILLIMETRES = 3
"""Decimals of what is written into edits.toml."""


class Conflict(Exception):
    """Why an edit cannot be applied, in words."""


@dataclass(frozen=True)
class Fitting:
    """When a thing is the one that is meant (parameters of `edit map`)."""

    minimum_overlap: float
    margin: float
    """[m]"""
    reach: float
    """[m]"""
    clear_share: float

    def overlap(self, a: Box, b: Box) -> float:
        """Return the intersection over union, 0 to 1, of two upright boxes grown by the margin."""
        return box_iou(self._grown(a), self._grown(b))

    def _grown(self, box: Box) -> Box:
        return gravity_aligned_box(box.center, np.asarray(box.size) + 2 * self.margin, box_yaw(box))


def find(anchor: Anchor, things: Sequence[Thing], fitting: Fitting, also: Sequence[str] = ()) -> Thing:
    """Return the one thing that fits an anchor, of its class or one of `also`. Raises Conflict."""
    box = upright_box(anchor.box)
    fits = sorted(
        ((fitting.overlap(box, thing.box), thing) for thing in things if passes(thing, anchor, fitting)),
        key=lambda pair: (-pair[0], pair[1].instance),
    )
    good = [(overlap, thing) for overlap, thing in fits if overlap >= fitting.minimum_overlap]
    named = [(overlap, thing) for overlap, thing in good if thing.class_name in (anchor.class_name, *also)]
    if not named:
        raise Conflict(_why_none(anchor, fits, good))
    rivals = [thing for overlap, thing in good if overlap >= fitting.clear_share * named[0][0]]
    if len(rivals) > 1:
        both = ", ".join(f"{thing.name} ({overlap:.2f})" for overlap, thing in good[:2])
        raise Conflict(f"{_place(anchor)} more than one thing fits: {both}")
    return named[0][1]


def passes(thing: Thing, anchor: Anchor, fitting: Fitting) -> bool:
    """Whether the surface of a thing comes within reach of an anchor's point."""
    return bool(thing.surface.query(anchor.point, distance_upper_bound=fitting.reach)[0] <= fitting.reach)


def _place(anchor: Anchor) -> str:
    return "at ({:.2f}, {:.2f}, {:.2f}) m".format(*anchor.point)


def _why_none(anchor: Anchor, fits: list[tuple[float, Thing]], good: list[tuple[float, Thing]]) -> str:
    if good:
        return f"{_place(anchor)} lies {good[0][1].name}, which is no {anchor.class_name}"
    if fits:
        overlap, thing = fits[0]
        return f"{_place(anchor)} lies {thing.name}, whose box is another one (overlap {overlap:.2f})"
    return f"{_place(anchor)} lies no thing"


def anchor_of(state: MapState, instance: int) -> Anchor:
    """Return the anchor of a thing of a map, rounded to millimetres. Raises KeyError when it has no surface.

    Its point is the vertex farthest from the surface of everything else, so that it stays on the thing when borders
    move.
    """
    thing = next((thing for thing in state.things() if thing.instance == instance), None)
    if thing is None:
        raise KeyError(instance)
    own = state.instance == instance
    points, others = state.surface.vertices[own].astype(float), state.surface.vertices[~own]
    inner = int(np.argmax(cKDTree(others).query(points)[0])) if len(others) else 0
    x, y, z = (round(float(value), MILLIMETRES) for value in points[inner])
    return Anchor.model_validate({"class": thing.class_name, "box": written_box(thing.box), "point": (x, y, z)})


def written_box(box: Box) -> UprightBox:
    """Return an upright box as it is written down, to millimetres and hundredths of a degree."""
    cx, cy, cz = (round(value, MILLIMETRES) for value in box.center)
    sx, sy, sz = (max(round(value, MILLIMETRES), 10.0**-MILLIMETRES) for value in box.size)
    return UprightBox(center=(cx, cy, cz), size=(sx, sy, sz), yaw_degrees=round(math.degrees(box_yaw(box)), 2))


def joint_anchor(anchors: Sequence[Anchor]) -> Anchor:
    """Return the anchor of what the things of several anchors are together; its point is that of the first."""
    corners = np.concatenate([box_corners(upright_box(anchor.box)) for anchor in anchors])
    first = anchors[0]
    return Anchor.model_validate(
        {"class": first.class_name, "box": written_box(minimum_box(corners)), "point": first.point}
    )
