"""In a place that is strange to the segmenter: only the masks and the names that most views agree on."""

from __future__ import annotations

import numpy as np
import pytest

from stages.fuse.closing import MaskSource, is_strange
from stages.fuse.extraction import ExtractedEntity, LabelledSurface
from stages.fuse.parameters import FuseParameters
from stages.fuse.strange_places import LEAST_NAME_SCORE, LEAST_THING_SCORE, thing_score, without_doubtful
from stages.kit.formats.ply_files import ColoredMesh
from tests.unit.fuse.scenes import THINGS, class_id

WALL, FRIDGE, CHAIR, OBJECT = (class_id(name) for name in ("wall", "fridge", "chair", "object"))
MESH = ColoredMesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32), np.zeros((3, 3), np.uint8))


def entity(instance: int, class_name: int) -> ExtractedEntity:
    return ExtractedEntity(instance, class_name, (instance,), MESH, 0.9, 5)


def test_the_score_counts_views_that_had_no_mask() -> None:
    scores = {1: {CHAIR: 2.0, FRIDGE: 1.0, WALL: 3.0}, 2: {}}
    assert thing_score((1, 2), scores, THINGS, {1: 4, 2: 6}) == pytest.approx(0.3)
    assert thing_score((7,), scores, THINGS, {}) == 0.0


def test_what_views_do_not_agree_on_loses_its_name_or_its_surface() -> None:
    numbers = np.array([1, 2, 3, 4, 0], np.int32)
    labelled = LabelledSurface(numbers, np.array([WALL, FRIDGE, CHAIR, FRIDGE, 0], np.int32), numbers)
    scores = {
        2: {FRIDGE: 10 * LEAST_THING_SCORE - 0.1},
        3: {CHAIR: 10 * LEAST_NAME_SCORE - 0.1, OBJECT: 4.0},
        4: {FRIDGE: 10 * LEAST_NAME_SCORE + 0.1, OBJECT: 4.0},
    }
    entities = [entity(1, WALL), entity(2, FRIDGE), entity(3, CHAIR), entity(4, FRIDGE)]
    kept, surface = without_doubtful(entities, labelled, scores, dict.fromkeys(range(1, 5), 10), THINGS, OBJECT)
    assert [(e.instance, e.class_id) for e in kept] == [(1, WALL), (3, OBJECT), (4, FRIDGE)]
    assert surface.class_id.tolist() == [WALL, 0, OBJECT, FRIDGE, 0]
    assert surface.instance.tolist() == [1, 0, 3, 4, 0]


def test_only_a_segmenter_that_says_so_is_doubted() -> None:
    parameters = FuseParameters()
    assert is_strange(MaskSource("ours", parameters.least_recognised - 0.01), parameters)
    assert not is_strange(MaskSource("ours", parameters.least_recognised), parameters)
    assert not is_strange(MaskSource("masks of a folder", None), parameters)
    assert not is_strange(MaskSource("ours", 0.0), FuseParameters(least_recognised=0.0))
