"""Pieces that geometry cut are named where most of what masks said of them is one name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.fuse.agreed_names import said_of, with_agreed_names, without_claimed
from scenewright.stages.fuse.extraction import ExtractedEntity, LabelledSurface
from scenewright.stages.kit.formats.ply_files import ColoredMesh

from tests.unit.fuse.scenes import class_id

WALL, CHAIR, TABLE, OBJECT = (class_id(name) for name in ("wall", "chair", "table", "object"))


def piece(instance: int, size: float = 0.9, class_name: int = OBJECT) -> ExtractedEntity:
    corners = np.array([[0, 0, 0], [size, 0, 0], [0, size, size]], np.float32)
    mesh = ColoredMesh(corners, np.array([[0, 1, 2]], np.int32), np.zeros((3, 3), np.uint8))
    return ExtractedEntity(instance, class_name, (), mesh, 0.9, 5)


def named(entity: ExtractedEntity, said: dict[int, float], looks: int = 10) -> int:
    """The class of a piece of one segment label whose masks had these scores in so many looks."""
    labelled = LabelledSurface(*(np.full(4, value, np.int32) for value in (3, entity.class_id, entity.instance)))
    (found,), result = with_agreed_names(
        [entity], labelled, {3: said}, {3: looks}, load_vocabulary(), OBJECT, minimum_share=0.15
    )
    assert np.all(result.class_id == found.class_id)
    return found.class_id


def test_what_was_said_is_the_mean_over_surface_and_looks() -> None:
    scores = {1: {CHAIR: 2.0, WALL: 1.0}, 2: {CHAIR: 1.0}}
    said = said_of(np.array([1, 1, 1, 2, 9, 9]), scores, {1: 4, 2: 2, 9: 5})
    assert said == {CHAIR: pytest.approx(0.5 * 0.5 + 0.5 / 6), WALL: pytest.approx(0.125)}


def test_most_must_agree() -> None:
    assert named(piece(1), {CHAIR: 4.0, TABLE: 3.0}) == CHAIR
    assert named(piece(1), {CHAIR: 4.0, TABLE: 3.0, OBJECT: 2.0}) == OBJECT, "who names nothing is asked too"
    assert named(piece(1), {CHAIR: 4.0, WALL: 9.0}) == CHAIR, "a thing it is, whatever is behind it"
    assert named(piece(1), {OBJECT: 6.0}) == OBJECT and named(piece(1), {}) == OBJECT


def test_few_looks_are_not_enough() -> None:
    assert named(piece(1), {CHAIR: 1.4}) == OBJECT and named(piece(1), {CHAIR: 1.6}) == CHAIR


def test_a_thing_of_another_size_has_no_name() -> None:
    assert named(piece(1, size=0.05), {TABLE: 8.0}) == OBJECT


def test_a_name_that_is_there_stays() -> None:
    assert named(piece(1, class_name=TABLE), {CHAIR: 9.0}) == TABLE


def test_what_masks_said_of_a_thing_names_no_piece_beside_it() -> None:
    table = replace(piece(1, class_name=TABLE), segments=(3, 5))
    assert without_claimed({3: {TABLE: 8.0}, 4: {CHAIR: 2.0}}, [table, piece(2)]) == {4: {CHAIR: 2.0}}
