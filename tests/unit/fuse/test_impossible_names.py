"""Names that the size of a thing in the map speaks against, where few of its views said them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.impossible_names import BELIEVED, UNUSUAL, without_impossible_names
from scenewright.stages.kit.formats.ply_files import ColoredMesh

from tests.unit.fuse.scenes import class_id

CHAIR, PLANT, OBJECT = class_id("chair"), class_id("plant"), class_id("object")


def thing(instance: int, class_name: int, size: float) -> ExtractedEntity:
    box = trimesh.creation.box((size, size, size)).subdivide().subdivide()
    colors = np.zeros((len(box.vertices), 3), np.uint8)
    mesh = ColoredMesh(box.vertices.astype(np.float32), box.faces.astype(np.int32), colors)
    return ExtractedEntity(instance, class_name, (instance,), mesh, 0.9, 5)


def renamed(things: list[ExtractedEntity], scores: dict[int, dict[int, float]]) -> list[int]:
    """Classes that things have then, each seen ten times."""
    numbers, classes = ([getattr(each, name) for each in things] for name in ("instance", "class_id"))
    labelled = LabelledSurface(*(np.array(row, np.int32) for row in (numbers, classes, numbers)))
    sightings = dict.fromkeys(scores, 10)
    found, labels = without_impossible_names(things, labelled, scores, sightings, load_vocabulary(), OBJECT)
    assert [replace(each, class_id=0) for each in found] == [replace(each, class_id=0) for each in things]
    assert labelled.class_id.tolist() == classes, "not in place"
    assert labels.class_id.tolist() == [each.class_id for each in found]
    return labels.class_id.tolist()


def test_doubtful_names_need_a_possible_size() -> None:
    tiny, usual, tall = thing(1, CHAIR, 0.1), thing(2, CHAIR, 0.6), thing(3, PLANT, 1.8)

    def names(score: float) -> list[int]:
        return renamed([tiny, usual, tall], {1: {CHAIR: score}, 2: {CHAIR: score}, 3: {PLANT: score}})

    assert names(10 * BELIEVED - 0.5) == [OBJECT, CHAIR, OBJECT]
    assert names(10 * BELIEVED) == [CHAIR, CHAIR, PLANT], "most views say so: a corner of one, an unusually tall one"


def test_no_view_is_believed_beyond_measure() -> None:
    assert renamed([thing(1, PLANT, 1.2 * UNUSUAL * 2.5)], {1: {PLANT: 10.0}}) == [OBJECT]


def test_the_next_name_that_it_can_have() -> None:
    cup = class_id("cup")
    assert renamed([thing(1, cup, 0.6)], {1: {cup: 6.0, CHAIR: 3.0, PLANT: 1.0}}) == [CHAIR]
    assert renamed([thing(1, cup, 0.6)], {1: {cup: 6.0, OBJECT: 3.0, CHAIR: 1.0}}) == [OBJECT], "hardly a mask said so"
