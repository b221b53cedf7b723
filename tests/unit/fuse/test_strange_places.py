"""In a place that is strange to the segmenter: no names, and only the masks that most views had."""

from __future__ import annotations

import numpy as np
import pytest

from stages.fuse.closing import MaskSource, is_strange
from stages.fuse.extraction import ExtractedEntity, LabelledSurface
from stages.fuse.parameters import FuseParameters
from stages.fuse.strange_places import LEAST_THING_SCORE, thing_score, without_names
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


def test_things_lose_their_names_and_doubtful_ones_their_surface() -> None:
    labelled = LabelledSurface(
        np.array([1, 2, 3, 4], np.int32), np.array([WALL, FRIDGE, CHAIR, 0], np.int32), np.array([1, 2, 3, 0], np.int32)
    )
    score_of = {1: 0.0, 2: LEAST_THING_SCORE - 0.01, 3: LEAST_THING_SCORE}
    kept, surface = without_names(
        [entity(1, WALL), entity(2, FRIDGE), entity(3, CHAIR)], labelled, score_of, THINGS, OBJECT
    )
    assert [(e.instance, e.class_id) for e in kept] == [(1, WALL), (3, OBJECT)]
    assert surface.class_id.tolist() == [WALL, 0, OBJECT, 0]
    assert surface.instance.tolist() == [1, 0, 3, 0]


def test_only_a_segmenter_that_says_so_is_doubted() -> None:
    parameters = FuseParameters()
    assert is_strange(MaskSource("ours", parameters.least_recognised - 0.01), parameters)
    assert not is_strange(MaskSource("ours", parameters.least_recognised), parameters)
    assert not is_strange(MaskSource("masks of a folder", None), parameters)
    assert not is_strange(MaskSource("ours", 0.0), FuseParameters(least_recognised=0.0))
