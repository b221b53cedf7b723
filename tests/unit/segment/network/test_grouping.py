"""Decoding: constructed perfect heads must give back the instances, whatever their number, class and overlap."""

import numpy as np
import pytest
from scenewright.stages.segment.backends.network.grouping import (
    GroupingSettings,
    Named,
    assign_to_centres,
    find_centres,
    group,
    raise_to_depth,
)
from scenewright.stages.segment.training.network.targets import IGNORED, make_targets

CLASSES = (Named(1, False), Named(2, False), Named(4, True), Named(5, True))


def perfect_heads(labels: np.ndarray, class_of_label: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return logits, heat and offsets as a network without error would."""
    things = np.array([index != IGNORED and CLASSES[index].is_thing for index in class_of_label])
    targets = make_targets(labels, class_of_label, things)
    logits = np.full((len(CLASSES), *labels.shape), -8.0, dtype=np.float32)
    for index in range(len(CLASSES)):
        logits[index][targets.classes == index] = 8.0
    return logits, targets.centres, targets.offsets


def scene() -> tuple[np.ndarray, np.ndarray]:
    """Floor 1, wall 2, a table 3 split by a chair 4 that stands before it, a second chair 5, a small thing 6."""
    labels = np.ones((120, 160), dtype=np.int64)
    labels[:40] = 2
    labels[50:80, 20:120] = 3
    labels[45:100, 60:75] = 4
    labels[60:110, 130:150] = 5
    labels[42:48, 30:36] = 6
    return labels, np.array([IGNORED, 0, 1, 3, 2, 2, 3])


def test_perfect_heads_give_back_every_instance() -> None:
    labels, class_of_label = scene()
    found = group(*perfect_heads(labels, class_of_label), CLASSES)
    assert len(found.masks) == 6
    for label in range(1, 7):
        numbers = np.unique(found.ids[labels == label])
        assert len(numbers) == 1 and numbers[0] > 0
        assert np.array_equal(found.ids == numbers[0], labels == label)
        mask, named = found.masks[int(numbers[0])], CLASSES[class_of_label[label]]
        assert (mask.class_id, mask.is_thing) == (named.class_id, named.is_thing)
        assert mask.score > 0.99


def test_pixels_without_a_class_get_no_mask_only_where_the_heads_say_nothing() -> None:
    logits = np.zeros((4, 20, 20), dtype=np.float32)
    found = group(logits, np.zeros((20, 20), np.float32), np.zeros((2, 20, 20), np.float32), CLASSES)
    assert not found.masks and not found.ids.any()  # a quarter each is under the score threshold


def test_the_class_of_an_instance_is_that_of_most_of_its_pixels() -> None:
    labels, class_of_label = scene()
    logits, heat, offsets = perfect_heads(labels, class_of_label)
    chair = np.argwhere(labels == 5)
    for row, column in chair[: len(chair) // 3]:
        logits[2, row, column], logits[3, row, column] = -8.0, 8.0
    found = group(logits, heat, offsets, CLASSES)
    numbers = np.unique(found.ids[labels == 5])
    assert len(numbers) == 1 and found.masks[int(numbers[0])].class_id == 4


def test_a_thing_that_is_not_recognised_becomes_the_unnamed_class_or_nothing() -> None:
    """Five kinds of things are equally likely: a thing it is, but which?"""
    classes = (Named(1, False), *(Named(k, True) for k in range(4, 9)), Named(40, True))
    logits = np.full((7, 20, 20), -8.0, dtype=np.float32)
    logits[0] = 0.0
    logits[1:6, 5:15, 5:15] = 4.0
    heat, offsets = np.zeros((20, 20), np.float32), np.zeros((2, 20, 20), np.float32)
    heat[10, 10] = 1.0
    found = group(logits, heat, offsets, classes, unnamed=6)
    number = int(found.ids[10, 10])
    assert np.array_equal(found.ids == number, logits[1] > 0)
    assert found.masks[number].class_id == 40 and 0.15 < found.masks[number].score < 0.2
    dropped = group(logits, heat, offsets, classes)
    assert not dropped.ids[10, 10] and len(dropped.masks) == 1


def test_centres_are_peaks_over_the_threshold_best_first() -> None:
    heat = np.zeros((40, 40), dtype=np.float32)
    heat[10, 10], heat[10, 12], heat[30, 30], heat[5, 35] = 0.9, 0.8, 0.95, 0.05
    found = find_centres(heat, np.ones((40, 40), dtype=bool), GroupingSettings())
    assert found.tolist() == [[30, 30], [10, 10]]
    assert not len(find_centres(heat, np.zeros((40, 40), dtype=bool), GroupingSettings()))


def test_assignment_agrees_with_the_plain_definition() -> None:
    random = np.random.default_rng(3)
    offsets, allowed = random.normal(0, 5, (2, 17, 23)), random.random((17, 23)) < 0.7
    centres = random.integers(0, 17, (5, 2))
    grid = np.moveaxis(np.mgrid[:17, :23] + offsets, 0, -1)
    distance = ((grid[:, :, None] - centres) ** 2).sum(axis=-1)
    expected = np.where(allowed, distance.argmin(axis=-1) + 1, 0)
    assert np.array_equal(assign_to_centres(allowed, offsets, centres), expected)
    assert not assign_to_centres(allowed, offsets, np.zeros((0, 2), dtype=np.int64)).any()


@pytest.mark.parametrize("edge", range(9, 15))
def test_raised_masks_end_where_the_depth_jumps(edge: int) -> None:
    """Whatever pixel of the full image an edge lies on: the coarse masks know it to four pixels, the depth exactly."""
    step, shape = 2, (48, 64)
    depth = np.full(shape, 3.0, dtype=np.float32)
    depth[:, :edge] = 1.0
    named_at = np.ascontiguousarray(depth[::step, ::step][::2, ::2])
    coarse = np.where(named_at < 2, 7, 9).astype(np.int32)
    assert np.array_equal(raise_to_depth(coarse, named_at, depth, float(step)), np.where(depth < 2, 7, 9))


def test_raised_masks_without_depth_take_the_nearest() -> None:
    coarse = np.arange(12, dtype=np.int32).reshape(3, 4)
    raised = raise_to_depth(coarse, np.zeros((3, 4), np.float32), np.zeros((12, 16), np.float32), 2.0)
    centre_rows = np.round(((np.arange(12) + 0.5) / 2 - 0.5) / 2).clip(0, 2)
    tie = np.isclose((((np.arange(12) + 0.5) / 2 - 0.5) / 2) % 1, 0.5)
    assert np.array_equal(raised[~tie, 0] // 4, centre_rows[~tie])
