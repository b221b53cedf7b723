"""In a place that is strange to the segmenter: no names, masks as proposals, walls and things by geometry."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.closing import MaskSource, is_strange
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.piece_entities import Classes, by_geometry
from scenewright.stages.fuse.strange_places import (
    LEAST_THING_SCORE,
    SURE,
    share_told,
    sure_things,
    thing_score,
    without_names,
)
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.kit.formats.ply_files import ColoredMesh

from tests.unit.fuse.scenes import THINGS, class_id
from tests.unit.fuse.test_unnamed_pieces import COUNTER, ON_IT, VOXEL, room

FLOOR, WALL, CEILING, FRIDGE, CHAIR, OBJECT = (
    class_id(name) for name in ("floor", "wall", "ceiling", "fridge", "chair", "object")
)
MESH = ColoredMesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32), np.zeros((3, 3), np.uint8))


def entity(instance: int, class_name: int) -> ExtractedEntity:
    return ExtractedEntity(instance, class_name, (instance,), MESH, 0.9, 5)


def test_the_score_counts_views_that_had_no_mask() -> None:
    scores = {1: {CHAIR: 2.0, FRIDGE: 1.0, WALL: 3.0}, 2: {}}
    assert thing_score((1, 2), scores, THINGS, {1: 4, 2: 6}) == pytest.approx(0.3)
    assert thing_score((7,), scores, THINGS, {}) == 0.0


def test_the_share_of_a_surface_is_that_of_its_segment_and_class() -> None:
    labelled = LabelledSurface(*(np.array(row, np.int32) for row in ([1, 1, 2], [CHAIR, FRIDGE, CHAIR], [5, 6, 5])))
    assert share_told(labelled, {1: {CHAIR: 3.0, FRIDGE: 1.0}}, {1: 4, 2: 9}) == pytest.approx([0.75, 0.25, 0.0])


def test_things_lose_their_names_and_doubtful_ones_their_surface() -> None:
    numbers = np.array([1, 2, 3, 0], np.int32)
    labelled = LabelledSurface(numbers, np.array([WALL, FRIDGE, CHAIR, 0], np.int32), numbers)
    score_of = {1: 0.0, 2: LEAST_THING_SCORE - 0.01, 3: LEAST_THING_SCORE}
    entities = [entity(1, WALL), entity(2, FRIDGE), entity(3, CHAIR)]
    kept, surface = without_names(entities, labelled, score_of, THINGS, OBJECT)
    assert [(e.instance, e.class_id) for e in kept] == [(1, WALL), (3, OBJECT)]
    assert surface.class_id.tolist() == [WALL, 0, OBJECT, 0]
    assert surface.instance.tolist() == [1, 0, 3, 0]


def test_geometry_says_what_is_wall_and_what_becomes_of_a_proposal() -> None:
    vertices, faces, owner = room(COUNTER, ON_IT)
    surface = Surface(vertices, faces, np.zeros((len(vertices), 3), np.uint8), owner)
    fridge = (owner == 1) & (vertices[:, 0] > 1)  # a mask took a part of the wall for a thing, one the counter for wall
    number = np.select([owner == 0, owner == 2, fridge, owner == 3], [1, 2, 3, 4], 0)
    class_of = np.array([0, FLOOR, WALL, OBJECT, OBJECT], np.int32)
    labelled = LabelledSurface(owner.astype(np.int32), class_of[number], number.astype(np.int32))
    entities = [entity(k, int(class_of[k])) for k in range(1, 5)]
    classes = Classes(FLOOR, WALL, CEILING, OBJECT)
    found, result = by_geometry(surface, entities, labelled, classes, voxel=VOXEL, minimum_area=0.2)
    assert (result.class_id[owner == 1] == WALL).mean() > 0.9
    assert sorted(e.class_id for e in found) == sorted([FLOOR, WALL, OBJECT, OBJECT])
    counter, on_it = (int(np.bincount(result.instance[owner == part]).argmax()) for part in (2, 3))
    assert counter != on_it and {e.instance: e.segments for e in found}[on_it] == (4,)
    assert {e.instance: e.segments for e in found}[counter] == ()
    assert set(np.unique(result.instance)) <= {0, *(e.instance for e in found)}
    without = LabelledSurface(owner.astype(np.int32), np.zeros_like(class_of[number]), np.zeros_like(labelled.instance))
    assert by_geometry(surface, [], without, classes, voxel=VOXEL, minimum_area=0.2) == ([], without), "no floor"


def test_most_looks_make_a_thing_sure_but_no_table() -> None:
    entities = [entity(1, FRIDGE), entity(2, CHAIR), entity(3, FRIDGE), entity(4, WALL)]
    score_of = {1: SURE + 0.01, 2: 1.0, 3: SURE, 4: 1.0}
    assert sure_things(entities, score_of, frozenset({FRIDGE})) == {1}


@pytest.mark.parametrize("sure", [frozenset(), frozenset({3, 4})])
def test_no_wall_takes_and_no_top_cuts_what_masks_are_sure_of(sure: frozenset[int]) -> None:
    vertices, faces, owner = room(COUNTER, ON_IT)
    surface = Surface(vertices, faces, np.zeros((len(vertices), 3), np.uint8), owner)
    screen = (owner == 1) & (np.abs(vertices - [1.5, 2.0, 1.6]) < 0.3).all(axis=1)
    number = np.select([owner == 0, screen, owner >= 2], [1, 3, 4], 2)  # one mask took the counter with what is on it
    class_of = np.array([0, FLOOR, WALL, OBJECT, OBJECT], np.int32)
    labelled = LabelledSurface(owner.astype(np.int32), class_of[number], number.astype(np.int32))
    entities = [entity(k, int(class_of[k])) for k in range(1, 5)]
    classes = Classes(FLOOR, WALL, CEILING, OBJECT)
    _, result = by_geometry(surface, entities, labelled, classes, voxel=VOXEL, minimum_area=0.2, sure=sure)
    assert (result.class_id[screen] == (OBJECT if sure else WALL)).mean() > 0.9
    counter, on_it = (int(np.bincount(result.instance[owner == part]).argmax()) for part in (2, 3))
    assert (counter == on_it) == bool(sure)


def test_only_a_segmenter_that_says_so_is_doubted() -> None:
    parameters = FuseParameters()
    assert is_strange(MaskSource("ours", parameters.least_recognised - 0.01), parameters)
    assert not is_strange(MaskSource("ours", parameters.least_recognised), parameters)
    assert not is_strange(MaskSource("masks of a folder", None), parameters)
    assert not is_strange(MaskSource("ours", 0.0), FuseParameters(least_recognised=0.0))
