"""Where an edit lands in another map: by `edit map`, by instance number, on the nearest thing of the class."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
from scenewright.schemas.edits import Add, Anchor, Merge, SetFloor, SetGravity
from scenewright.stages.edit import MAP_EDITS, EditMapParameters, Fitting, MapState, apply_edits
from scenewright.stages.evaluate import TrueRoom

from benchmarks.experiments.edits.making import Asked
from benchmarks.experiments.edits.truth import MapTruth, true_object

FITTING = Fitting(**EditMapParameters.model_validate({}).model_dump())
Landing = Literal["right", "wrong", "conflict", "absent"]
"""`absent`: a conflict, and the map has nothing that is what the edit means."""
Arm = Callable[[Asked, MapState, MapTruth, TrueRoom], "Landing | None"]


def by_geometry(asked: Asked, state: MapState, truth: MapTruth, room: TrueRoom) -> Landing:
    """Apply the edit to a copy of the map and look at what it changed."""
    after = replace(state, entities=dict(state.entities), touched=set(), _things=dict(state._things))
    (record,) = apply_edits(after, [asked.edit], FITTING, MAP_EDITS)
    if record.status == "conflict":
        return "conflict" if all(truth.has(true) for true in asked.true) else "absent"
    named = [int(name.rsplit("_", 1)[1]) for name in record.things]
    if record.status == "already":
        if isinstance(asked.edit, Add):
            return "right" if truth.object_of.get(named[0]) == asked.true[0] else "wrong"
        return "right" if all(truth.covered_by.get(true) in named for true in asked.true) else "wrong"
    if isinstance(asked.edit, Add):
        things = frozenset(entry.instance for entry in room.evaluated(things_only=True))
        points = after.surface.vertices[after.instance == named[0]].astype(float)
        return "right" if true_object(points, room, things) == asked.true[0] else "wrong"
    changed = {int(k) for k in np.unique(state.instance[np.isin(after.instance, named)])}
    return "right" if sorted(truth.object_of.get(k, 0) for k in changed) == sorted(asked.true) else "wrong"


def by_number(asked: Asked, state: MapState, truth: MapTruth, room: TrueRoom) -> Landing | None:
    """Take the things that have the same numbers."""
    there = {thing.instance for thing in state.things()}
    return _judged(asked, truth, [k if k in there else None for k in asked.instances])


def by_nearest(asked: Asked, state: MapState, truth: MapTruth, room: TrueRoom) -> Landing | None:
    """Take the thing of the class whose box has the nearest centre."""
    found: list[int | None] = []
    for anchor in _anchors(asked):
        same = [thing for thing in state.things() if thing.class_name == anchor.class_name]
        far = [float(np.linalg.norm(np.subtract(thing.box.center, anchor.box.center))) for thing in same]
        found.append(same[int(np.argmin(far))].instance if same else None)
    return _judged(asked, truth, found)


def _anchors(asked: Asked) -> tuple[Anchor, ...]:
    if isinstance(asked.edit, Add | SetGravity | SetFloor):
        return ()
    return asked.edit.of if isinstance(asked.edit, Merge) else (asked.edit.of,)


def _judged(asked: Asked, truth: MapTruth, found: list[int | None]) -> Landing | None:
    """Judge things that were found, None where there is none; nothing can be said of what is added."""
    if isinstance(asked.edit, Add):
        return None
    if None in found:
        return "conflict" if all(truth.has(true) for true in asked.true) else "absent"
    right = all(truth.object_of.get(k or 0) == true for k, true in zip(found, asked.true, strict=True))
    return "right" if right else "wrong"


ARMS: dict[str, Arm] = {"ours": by_geometry, "number": by_number, "nearest": by_nearest}
