"""Entities from labels (2.6): ties, background, specks, far parts, cut meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.stages.fuse.extraction import ExtractionSettings, confidence_of, extract_entities, label_of_segments
from scenewright.stages.fuse.merging import Grouping
from scenewright.stages.fuse.parts import absorb_pieces, absorb_specks, connected_parts, drop_far_parts, spread_labels
from scenewright.stages.fuse.surface import Surface
from scenewright.stages.kit.formats.map_files import face_labels

from tests.unit.fuse.test_association import CHAIR, TABLE, counted

THINGS = frozenset({CHAIR, TABLE})
SETTINGS = ExtractionSettings(
    minimum_share=0.15, minimum_voxels=3, minimum_observations=1, speck_share=0.0, part_distance=1.0
)


def strip(length: int, spacing: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """A ribbon of 2 x length vertices: vertices (2 length, 3) and its triangles."""
    x = np.repeat(np.arange(length), 2) * spacing
    vertices = np.stack([x, np.tile([0, spacing], length), 0 * x], axis=1).astype(np.float32)
    first = np.arange(2 * length - 2)
    return vertices, np.stack([first, first + 1, first + 2], axis=1).astype(np.int32)


def test_labels_of_segments() -> None:
    counts = counted((1, CHAIR, 1, 3), (2, TABLE, 5, 1), (4, TABLE, 5, 2))
    classes, instances = label_of_segments(Grouping(counts, {}, {}), {1: 3, 2: 10, 4: 10}, 5, 0.15)
    assert classes.tolist() == [0, CHAIR, 0, 0, TABLE, 0] and instances.tolist() == [0, 1, 0, 0, 5, 0]
    _, instances = label_of_segments(Grouping(counts, {}, {}), {1: 3, 2: 10, 4: 10}, 5, 0.0)
    assert instances.tolist() == [0, 1, 5, 0, 5, 0], "the rule of the thesis: the background has no vote"


def test_confidence_is_the_agreeing_share() -> None:
    counts = counted((1, CHAIR, 1, 3), (1, CHAIR, 2, 1), (2, CHAIR, 1, 4), (2, TABLE, 9, 2))
    assert confidence_of(counts, (1, 2), CHAIR, 1) == pytest.approx(0.7)
    assert confidence_of(counts, (), CHAIR, 1) == 0.0


def test_faces_between_labels_belong_to_neither() -> None:
    labels = np.array([1, 1, 2, 3, 1])
    faces = np.array([[0, 1, 4], [0, 1, 2], [2, 0, 1], [0, 2, 1], [2, 3, 0]])
    assert face_labels(labels, faces).tolist() == [1, 0, 0, 0, 0]


def test_parts_are_connected_by_equal_labels() -> None:
    _, faces = strip(4)
    parts = connected_parts(np.array([1, 1, 1, 2, 2, 2, 1, 1]), faces)
    assert parts.tolist() == [0, 0, 0, 3, 3, 3, 6, 6]


def test_specks_take_the_label_of_their_surroundings() -> None:
    _, faces = strip(20)
    labels = np.array([1] * 18 + [2] * 2 + [1] * 10 + [3] * 10)
    absorbed = absorb_specks(labels, faces, whole=frozenset(), minimum_size=3, minimum_share=0.0)
    assert absorbed.tolist() == [1] * 30 + [3] * 10
    # By share: the second part of 1 is under 60 % of its first; it lies between 2 and 3, which are not small.
    labels = np.array([1] * 7 + [2] * 15 + [1] * 4 + [3] * 14)
    assert absorb_specks(labels, faces, whole=frozenset({1}), minimum_size=3, minimum_share=0.6).tolist() == list(
        labels
    )
    shared = absorb_specks(labels, faces, whole=frozenset(), minimum_size=3, minimum_share=0.6)
    assert shared.tolist() == [1] * 7 + [2] * 19 + [3] * 14, "a tie goes to the smaller label"


def test_a_piece_of_a_large_thing_does_not_join_a_small_one() -> None:
    _, faces = strip(20)
    labels = np.array([1] * 22 + [2] * 12 + [1] * 6)
    assert absorb_specks(labels, faces, whole=frozenset(), minimum_size=3, minimum_share=0.6).tolist() == list(labels)
    # Too small to stand alone, it is nothing rather than a part of its neighbour.
    assert absorb_specks(labels, faces, whole=frozenset(), minimum_size=8, minimum_share=0.0).tolist() == (
        [1] * 22 + [2] * 12 + [0] * 6
    )


def test_lone_specks_become_unlabelled() -> None:
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    labels = np.array([1, 1, 1, 2, 2, 2])
    assert absorb_specks(labels, faces, whole=frozenset(), minimum_size=4, minimum_share=0).tolist() == [0] * 6


def test_far_parts_are_not_of_the_thing() -> None:
    vertices, faces = strip(30, spacing=0.1)
    gap = 2 * 12  # faces across the gap are taken out
    faces = faces[~((faces >= gap).any(axis=1) & (faces < gap + 8).any(axis=1))]
    labels = np.full(60, 7)
    labels[gap : gap + 8] = 0
    kept = drop_far_parts(labels, vertices, faces, whole=frozenset(), distance=0.6)
    assert kept.tolist() == labels.tolist(), "0.5 m of gap"
    near = drop_far_parts(labels, vertices, faces, whole=frozenset(), distance=0.4)
    assert near.tolist() == [0] * (gap + 8) + [7] * (60 - gap - 8), "the larger part stays"
    assert drop_far_parts(labels, vertices, faces, whole=frozenset({7}), distance=0.4).tolist() == labels.tolist()


def test_entities_partition_the_surface() -> None:
    vertices, faces = strip(20)
    surface = Surface(vertices, faces, np.full((40, 3), 9, np.uint8), np.zeros(40, np.int32))
    segment = np.array([1] * 16 + [2] * 12 + [3] * 12, dtype=np.int32)
    counts = counted((1, CHAIR, 4, 5), (2, CHAIR, 4, 5), (3, TABLE, 2, 5))
    seen = {4: 0b111, 2: 0b1}
    entities, labels = extract_entities(
        surface, segment, Grouping(counts, {}, seen), {1: 5, 2: 5, 3: 5}, THINGS, SETTINGS
    )
    assert [(e.instance, e.class_id, e.segments, e.observations) for e in entities] == [
        (2, TABLE, (3,), 1),
        (4, CHAIR, (1, 2), 3),
    ]
    assert sum(len(e.mesh.faces) for e in entities) == len(faces) - 2, "the two faces between them belong to neither"
    assert labels.instance.tolist() == [4] * 28 + [2] * 12
    assert labels.class_id.tolist() == [CHAIR] * 28 + [TABLE] * 12
    settings = replace(SETTINGS, minimum_observations=2)
    entities, labels = extract_entities(
        surface, segment, Grouping(counts, {}, seen), {1: 5, 2: 5, 3: 5}, THINGS, settings
    )
    assert [e.instance for e in entities] == [4] and labels.instance.tolist() == [4] * 28 + [0] * 12


def test_labels_spread_over_smooth_surface_and_not_round_a_corner() -> None:
    # Two strips of vertices that meet at a right angle: x = 0..5 on the floor, then up the wall.
    floor = [(x, y, 0.0) for x in range(6) for y in range(2)]
    wall = [(5.0, y, float(z)) for z in range(1, 6) for y in range(2)]
    vertices = np.array(floor + wall, dtype=np.float32)
    columns = [(2 * k, 2 * k + 1) for k in range(11)]
    faces = np.array(
        [f for (a, b), (c, d) in zip(columns, columns[1:], strict=False) for f in ((a, c, b), (b, c, d))], np.int32
    )
    labels = np.zeros(22, dtype=np.int32)
    labels[:4] = 7
    assert spread_labels(labels, vertices, faces, steps=0, minimum_cosine=0.7).tolist() == labels.tolist()
    once = spread_labels(labels, vertices, faces, steps=1, minimum_cosine=0.7)
    assert once.tolist() == [7] * 6 + [0] * 16
    # The vertices at the corner lean by 45 degrees: they are reached from the floor, what rises behind them is too,
    # unless a sharper bound is set.
    far = spread_labels(labels, vertices, faces, steps=20, minimum_cosine=0.95)
    assert far.tolist() == [7] * 10 + [0] * 12
    labels[-2:] = 9
    both = spread_labels(labels, vertices, faces, steps=20, minimum_cosine=0.95)
    assert both.tolist() == [7] * 10 + [0] * 2 + [9] * 10


def test_a_piece_joins_the_much_larger_thing_of_its_class_that_it_touches() -> None:
    _, faces = strip(30)
    labels = np.array([1] * 40 + [2] * 6 + [3] * 14)
    assert absorb_pieces(labels, faces, {1: CHAIR, 2: CHAIR, 3: CHAIR}, share=0.2).tolist() == [1] * 46 + [3] * 14
    assert absorb_pieces(labels, faces, {1: CHAIR, 2: TABLE, 3: CHAIR}, share=0.2).tolist() == list(labels)
    assert absorb_pieces(labels, faces, {1: CHAIR, 3: CHAIR}, share=0.2).tolist() == list(labels), "stuff joins nothing"
    assert absorb_pieces(labels, faces, {1: CHAIR, 2: CHAIR, 3: CHAIR}, share=0.1).tolist() == list(labels)
    apart = np.array([1] * 40 + [0] * 6 + [2] * 6 + [0] * 8)
    assert absorb_pieces(apart, faces, {1: CHAIR, 2: CHAIR}, share=0.2).tolist() == list(apart)


def test_pieces_of_pieces_end_at_the_whole() -> None:
    _, faces = strip(40)
    labels = np.array([1] * 60 + [2] * 11 + [3] * 2 + [0] * 7)
    result = absorb_pieces(labels, faces, {1: CHAIR, 2: CHAIR, 3: CHAIR}, share=0.2)
    assert result.tolist() == [1] * 73 + [0] * 7


@pytest.mark.parametrize(("unnamed", "expected"), [(None, [4]), (CHAIR, [4, 5])])
def test_things_without_a_name_are_no_pieces_of_each_other(unnamed: int | None, expected: list[int]) -> None:
    vertices, faces = strip(30)
    surface = Surface(vertices, faces, np.full((60, 3), 9, np.uint8), np.zeros(60, np.int32))
    segment = np.array([1] * 52 + [2] * 8, dtype=np.int32)
    grouping = Grouping(counted((1, CHAIR, 4, 5), (2, CHAIR, 5, 5)), {}, {4: 0b111, 5: 0b111})
    settings = replace(SETTINGS, piece_share=0.2, unnamed=unnamed)
    entities, _ = extract_entities(surface, segment, grouping, {1: 5, 2: 5}, THINGS, settings)
    assert [entity.instance for entity in entities] == expected
