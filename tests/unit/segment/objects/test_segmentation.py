"""Objects of analytic tabletops: boxes, a cut through flush boxes, an occluder, files of trees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.backends.objects.backend import BUNDLED, ObjectsBackend
from scenewright.stages.segment.backends.objects.boosting import read_trees, score_rows, write_trees
from scenewright.stages.segment.backends.objects.grouping import by_trees
from scenewright.stages.segment.backends.objects.pairs import FEATURES
from scenewright.stages.segment.backends.objects.plain import segment_plain
from scenewright.stages.segment.backends.objects.segmentation import (
    BY_SET_RULES,
    ObjectFrame,
    ObjectSettings,
    cut_pieces,
    segment_objects,
)
from scenewright.stages.segment.training.tabletop_pairs.pair_recording import record_pairs

from tests.unit.segment.scenes import best_overlap, box_depth, combine, plane_depth, rays

CAMERA = Camera(width=320, height=240, fx=262.5, fy=262.5, cx=159.5, cy=119.5)
RAYS = rays(CAMERA)
TABLE = plane_depth(RAYS, (0.0, 1.0, 0.0), 0.35)
"""35 cm below a camera that looks straight ahead; cut off at 2 m."""
TABLE = np.where(TABLE < 2.0, TABLE, np.inf)
TREES = read_trees(BUNDLED, FEATURES)


def tabletop(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Depth and owner (0 table) of boxes (middle, size) on the table."""
    depth, which = combine(TABLE, *(box_depth(RAYS, middle, size, 0.0) for middle, size in boxes))
    return depth, np.maximum(which - 1, 0)


def painted(owner: np.ndarray, *colors: tuple[int, int, int]) -> np.ndarray:
    """A picture in which every owner has one colour, the table grey."""
    return np.array([(150, 150, 150), *colors], dtype=np.uint8)[owner]


def both(color: np.ndarray, depth: np.ndarray) -> list[ObjectFrame]:
    """Rules and trees."""
    return [segment_objects(color, depth, CAMERA), segment_objects(color, depth, CAMERA, by_trees(TREES))]


def test_two_boxes_apart_are_two_objects() -> None:
    depth, owner = tabletop(((-0.2, 0.27, 0.9), (0.16, 0.16, 0.1)), ((0.2, 0.25, 0.9), (0.15, 0.2, 0.1)))
    color = painted(owner, (200, 40, 40), (40, 60, 190))
    for found in (*(frame.labels for frame in both(color, depth)), segment_plain(depth, CAMERA)):
        assert found.max() == 2
        assert best_overlap(found, owner == 1)[1] > 0.9
        assert best_overlap(found, owner == 2)[1] > 0.9


def test_flush_boxes_of_other_colours_are_cut_where_they_meet() -> None:
    depth, owner = tabletop(((-0.08, 0.25, 0.8), (0.16, 0.2, 0.1)), ((0.08, 0.25, 0.8), (0.16, 0.2, 0.1)))
    found = segment_objects(painted(owner, (210, 60, 40), (30, 80, 200)), depth, CAMERA).labels
    assert found.max() == 2
    assert best_overlap(found, owner == 1)[1] > 0.9
    assert segment_plain(depth, CAMERA).max() == 1  # no depth shows the border


def test_a_box_behind_a_post_is_one_object() -> None:
    depth, owner = tabletop(((0.0, 0.25, 1.0), (0.5, 0.2, 0.1)), ((0.0, 0.2, 0.7), (0.07, 0.3, 0.07)))
    found = segment_objects(painted(owner, (60, 160, 70), (200, 190, 60)), depth, CAMERA).labels
    assert found.max() == 2
    assert best_overlap(found, owner == 1)[1] > 0.85


def test_a_recording_knows_which_pairs_are_one_object() -> None:
    depth, owner = tabletop(((-0.08, 0.25, 0.8), (0.16, 0.2, 0.1)), ((0.08, 0.25, 0.8), (0.16, 0.2, 0.1)))
    color = painted(owner, (210, 60, 40), (30, 80, 200))
    pieces = cut_pieces(color, depth, CAMERA, ObjectSettings())
    recorded = record_pairs(pieces, owner, BY_SET_RULES, 0.0, 1.0, np.random.default_rng(0))
    assert len(np.unique(pieces.groups.group_of[1:])) == 2  # by the truth
    # Each box shows two faces, so that there are pairs of both kinds, and the last one looked at is the two boxes.
    assert set(recorded.answers.tolist()) == {0, 1}
    assert recorded.answers[-1] == 0
    assert recorded.features.shape == (len(recorded.answers), len(FEATURES))


def test_the_same_frame_gives_the_same_labels() -> None:
    depth, owner = tabletop(((-0.08, 0.25, 0.8), (0.16, 0.2, 0.1)), ((0.2, 0.25, 0.9), (0.15, 0.2, 0.1)))
    color = painted(owner, (210, 60, 40), (30, 80, 200))
    first, second = (segment_objects(color, depth, CAMERA, by_trees(TREES)).labels for _ in range(2))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("depth", [np.zeros((240, 320), np.float32), np.where(np.isfinite(TABLE), TABLE, 0)])
def test_an_empty_frame_and_an_empty_table_have_no_objects(depth: np.ndarray) -> None:
    color = np.zeros((240, 320, 3), np.uint8)
    assert segment_objects(color, depth, CAMERA).labels.max() == 0
    assert segment_plain(depth.astype(np.float32), CAMERA).max() == 0


def test_shapes_must_match_the_camera() -> None:
    with pytest.raises(ValueError, match="do not match"):
        segment_objects(np.zeros((10, 10, 3), np.uint8), np.zeros((10, 10), np.float32), CAMERA)


def test_the_backend_names_objects_and_drops_what_is_too_large() -> None:
    depth, owner = tabletop(((-0.2, 0.27, 0.9), (0.16, 0.16, 0.1)), ((0.2, 0.25, 0.9), (0.15, 0.2, 0.1)))
    color = painted(owner, (200, 40, 40), (40, 60, 190))
    frame = Frame(index=0, time=0.0, color=color, depth=depth, labels=None, world_from_camera=None)
    vocabulary = load_vocabulary()
    for largest, count in ((0.6, 2), (0.05, 0)):
        backend = ObjectsBackend(vocabulary, CAMERA, scorer=by_trees(TREES), largest=largest)
        panoptic = backend(frame, None, np.random.default_rng(0))  # type: ignore[arg-type]
        assert len(panoptic.masks) == count
        assert set(np.unique(panoptic.ids)) - {0} == set(panoptic.masks)
        assert all(mask.class_id == vocabulary.by_name("object").id for mask in panoptic.masks.values())


def test_trees_score_as_written_down_by_hand(tmp_path: Path) -> None:
    trees = (
        np.array([[0, 1, 1]], np.int32),
        np.array([[0.5, 1.0, 2.0]], np.float32),
        np.array([[1, 2, 3, 4]], np.float32),
        -0.25,
    )
    path = tmp_path / "trees.safetensors"
    write_trees(path, trees, ("a", "b"), "by hand")
    read = read_trees(path, ("a", "b"))
    for row, value in (((0.5, 1.0), 1), ((0.5, 1.5), 2), ((0.6, 2.0), 3), ((0.6, 2.1), 4)):
        assert score_rows(np.array(row, np.float32), read) == pytest.approx(value - 0.25)


def test_files_that_are_no_trees_for_these_features(tmp_path: Path) -> None:
    path = tmp_path / "trees.safetensors"
    node = np.array([[5]], np.int32)
    leaf = np.array([[0, 1]], np.float32)
    write_trees(path, (node, np.zeros((1, 1), np.float32), leaf, 0.0), ("a", "b"), "a feature too many")
    with pytest.raises(BadInput, match="balanced trees"):
        read_trees(path, ("a", "b"))
    with pytest.raises(BadInput, match="other features"):
        read_trees(path, ("a", "c"))
    path.write_bytes(b"nonsense")
    with pytest.raises(BadInput):
        read_trees(path, ("a", "b"))
