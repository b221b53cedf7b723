"""Names that the size of a thing in the map speaks against, where few of its views said them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from schemas.vocabulary import load_vocabulary
from stages.fuse.extraction import ExtractedEntity, LabelledSurface
from stages.fuse.impossible_names import BELIEVED, without_impossible_names
from stages.kit.formats.ply_files import ColoredMesh
from tests.unit.fuse.scenes import class_id

CHAIR, PLANT, OBJECT = class_id("chair"), class_id("plant"), class_id("object")


def thing(instance: int, class_name: int, size: float) -> ExtractedEntity:
    box = trimesh.creation.box((size, size, size)).subdivide().subdivide()
    colors = np.zeros((len(box.vertices), 3), np.uint8)
    mesh = ColoredMesh(box.vertices.astype(np.float32), box.faces.astype(np.int32), colors)
    return ExtractedEntity(instance, class_name, (instance,), mesh, 0.9, 5)


def test_doubtful_names_need_a_possible_size() -> None:
    tiny, usual, wall = thing(1, CHAIR, 0.1), thing(2, CHAIR, 0.6), thing(3, PLANT, 2.5)
    labelled = LabelledSurface(*(np.array(row, np.int32) for row in ([1, 2, 3], [CHAIR, CHAIR, PLANT], [1, 2, 3])))

    def names(score: float) -> tuple[list[int], list[int]]:
        scores = {1: {CHAIR: 10 * score}, 2: {CHAIR: 10 * score}, 3: {PLANT: 10 * score}}
        sightings = dict.fromkeys(scores, 10)
        found, labels = without_impossible_names(
            [tiny, usual, wall], labelled, scores, sightings, load_vocabulary(), OBJECT
        )
        assert [replace(each, class_id=0) for each in found] == [replace(e, class_id=0) for e in (tiny, usual, wall)]
        return [each.class_id for each in found], labels.class_id.tolist()

    assert names(BELIEVED - 0.05) == ([OBJECT, CHAIR, OBJECT],) * 2
    assert names(BELIEVED) == ([CHAIR, CHAIR, PLANT],) * 2, "most views say so: an unusual thing"
    assert labelled.class_id.tolist() == [CHAIR, CHAIR, PLANT], "not in place"
