"""The edits that a script makes on a map, and what each is about in truth.

Every thing is renamed, an edit each: where that lands says where any edit of the thing would. Things that lie nearest
to each other are merged, large things split at half their length, and true things that the map lacks are added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import TypeAdapter
from scenewright.schemas.edits import MapEdit
from scenewright.schemas.scene_parts import Box
from scenewright.stages.edit import MapState, anchor_of, written_box
from scenewright.stages.edit.map_state import Thing
from scenewright.stages.evaluate import TrueRoom
from scenewright.stages.kit.geometry.boxes import box_rotation, box_yaw, gravity_aligned_box

from benchmarks.experiments.edits.truth import MapTruth

KINDS = ("rename", "merge", "split", "add")
MERGES = SPLITS = 5
"""A room."""
SPLIT_LENGTH = 0.4
"""Shorter things are not split [m]."""
WIDER = 0.02
"""Boxes that somebody draws around a thing are this much wider than it on every side [m]."""
NEW_CLASS = "person"
"""What things are renamed to: a class that no recipe of the rooms has."""


@dataclass(frozen=True)
class Asked:
    """An edit and what it is about."""

    edit: MapEdit
    instances: tuple[int, ...]
    """Things of the map on which it was made; none for what is added."""
    true: tuple[int, ...]
    """The true thing of each, or of what is added."""


def edits_of(state: MapState, truth: MapTruth, room: TrueRoom) -> list[Asked]:
    """Return the edits of a map, in the order of KINDS."""
    things = [thing for thing in state.things() if thing.instance in truth.object_of]
    large = sorted(things, key=lambda thing: (-max(thing.box.size), thing.instance))[:SPLITS]
    missing = [entry for entry in room.evaluated(things_only=True) if not truth.has(entry.instance)]
    return [
        *(_about(state, truth, "rename", thing, **{"class": NEW_CLASS}) for thing in things),
        *(_about(state, truth, "merge", *pair) for pair in _neighbours(things, truth)[:MERGES]),
        *(
            _about(state, truth, "split", thing, part=_half(thing.box), **{"class": NEW_CLASS})
            for thing in large
            if max(thing.box.size) >= SPLIT_LENGTH
        ),
        *(
            Asked(_edit(what="add", box=_wider(entry.box), **{"class": entry.class_name}), (), (entry.instance,))
            for entry in missing
        ),
    ]


def _edit(**values: object) -> MapEdit:
    edit: MapEdit = TypeAdapter(MapEdit).validate_python(values)
    return edit


def _about(state: MapState, truth: MapTruth, what: str, *things: Thing, **values: object) -> Asked:
    """Return an edit of things of the map."""
    instances = tuple(thing.instance for thing in things)
    anchors = [anchor_of(state, instance).model_dump(by_alias=True) for instance in instances]
    of = anchors if len(anchors) > 1 else anchors[0]
    return Asked(_edit(what=what, of=of, **values), instances, tuple(truth.object_of[k] for k in instances))


def _neighbours(things: list[Thing], truth: MapTruth) -> list[tuple[Thing, Thing]]:
    """Return pairs of things that are not one in truth, the nearest first."""
    pairs = [
        (float(np.linalg.norm(np.subtract(a.box.center, b.box.center))), a.instance, b.instance, a, b)
        for k, a in enumerate(things)
        for b in things[k + 1 :]
        if truth.object_of[a.instance] != truth.object_of[b.instance]
    ]
    return [(a, b) for *_, a, b in sorted(pairs, key=lambda pair: pair[:3])]


def _half(box: Box) -> dict[str, object]:
    """Return the box around one half of a thing, cut across its longest edge, as it is written."""
    size = np.asarray(box.size)
    axis = int(np.argmax(size))
    shift = box_rotation(box)[:, axis] * (size[axis] / 2 + WIDER)
    return written_box(gravity_aligned_box(box.center + shift, size + 2 * WIDER, box_yaw(box))).model_dump()


def _wider(box: Box) -> dict[str, object]:
    """Return the box that somebody draws around a thing, as it is written."""
    return written_box(gravity_aligned_box(box.center, np.asarray(box.size) + 2 * WIDER, box_yaw(box))).model_dump()
