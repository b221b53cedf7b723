"""The corruption model does what its rates say, changes nothing at level 0, and repeats itself."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.segment.backends.ground_truth.corruption import (
    CorruptionRates,
    corrupt,
    displace_boundaries,
    rates_of_level,
)
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

CLASSES = {True: (4, 5, 17), False: (1, 2)}
ROWS, COLUMNS, SIZE = 6, 8, 20


def grid_frame() -> PanopticFrame:
    """48 things in a grid without gaps, 20x20 pixels each; the first row is stuff."""
    ids = np.zeros((ROWS * SIZE, COLUMNS * SIZE), dtype=np.int32)
    masks = {}
    for row in range(ROWS):
        for column in range(COLUMNS):
            number = row * COLUMNS + column + 1
            ids[row * SIZE : (row + 1) * SIZE, column * SIZE : (column + 1) * SIZE] = number
            masks[number] = PanopticMask(1 if row == 0 else 4, row > 0)
    return PanopticFrame(ids, masks)


def repeat(rates: CorruptionRates, times: int = 60) -> list[PanopticFrame]:
    return [corrupt(grid_frame(), rates, CLASSES, np.random.default_rng([5, k])) for k in range(times)]


def close(count: float, total: int, rate: float) -> bool:
    """Whether a count is within four standard deviations of what the rate promises."""
    return abs(count - total * rate) < 4 * np.sqrt(total * rate * (1 - rate))


def test_level_zero_is_the_identity() -> None:
    frame = grid_frame()
    same = corrupt(frame, rates_of_level(0.0), CLASSES, np.random.default_rng(0))
    assert np.array_equal(same.ids, frame.ids) and same.masks == frame.masks


def test_rates_grow_with_the_level() -> None:
    half, full = rates_of_level(0.5), rates_of_level(1.0)
    for name in ("flip", "miss", "merge", "split", "boundary"):
        assert getattr(half, name) == pytest.approx(getattr(full, name) / 2)
        assert getattr(full, name) > 0


def test_misses() -> None:
    frames = repeat(CorruptionRates(miss=0.15))
    assert close(sum(48 - len(frame.masks) for frame in frames), 60 * 48, 0.15)
    for frame in frames[:5]:
        for number in range(1, 49):
            assert (frame.ids == number).any() == (number in frame.masks)


def test_flips_keep_kind_and_choose_another_class_evenly() -> None:
    frames = repeat(CorruptionRates(flip=0.3))
    changed = [mask.class_id for frame in frames for number, mask in frame.masks.items() if number > 8]
    wrong = [category for category in changed if category != 4]
    assert close(len(wrong), 60 * 40, 0.3)
    assert close(wrong.count(5), len(wrong), 0.5) and set(wrong) == {5, 17}
    stuff = [mask.class_id for frame in frames for number, mask in frame.masks.items() if number <= 8]
    assert set(stuff) == {1, 2} and close(stuff.count(2), len(stuff), 0.3)


def test_merges_take_a_touching_thing() -> None:
    frames = repeat(CorruptionRates(merge=0.2))
    lost = sum(48 - len(frame.masks) for frame in frames)
    assert close(lost, 60 * 40, 0.2)
    for frame in frames:
        assert (frame.ids > 0).all(), "merging removes no pixel"
        assert set(range(1, 9)) <= set(frame.masks), "stuff is not merged"
    alone = PanopticFrame(np.pad(np.ones((5, 5), np.int32), 9), {1: PanopticMask(4, True)})
    assert corrupt(alone, CorruptionRates(merge=1.0), CLASSES, np.random.default_rng(0)).masks.keys() == {1}


def test_splits_make_two_of_one() -> None:
    frames = repeat(CorruptionRates(split=0.25))
    added = sum(len(frame.masks) - 48 for frame in frames)
    assert close(added, 60 * 40, 0.25)
    for frame in frames[:10]:
        for number in sorted(set(frame.masks) - set(range(1, 49))):
            half = frame.ids == number
            assert 0.25 * SIZE**2 < half.sum() < 0.75 * SIZE**2
            assert frame.masks[number].class_id == 4


def test_boundaries_wander_by_the_stated_deviation() -> None:
    ids = np.zeros((480, 640), dtype=np.int32)
    ids[:, 320:] = 1
    positions = []
    for k in range(6):
        moved = displace_boundaries(ids, 6.0, np.random.default_rng([1, k]))
        positions.append(640 - moved.sum(axis=1))
    shift = np.concatenate(positions) - 320
    assert abs(shift.mean()) < 2.0
    # The boundary moves by the displacement where it now lies; its spread is that of one axis.
    assert 4.0 < shift.std() < 8.0
    assert set(np.unique(moved)) == {0, 1}
    # Smooth: neighbouring rows move together.
    assert np.abs(np.diff(positions[0])).mean() < 2.0


def test_the_same_generator_gives_the_same_frame_and_others_differ() -> None:
    rates = rates_of_level(0.4)
    first, again, other = (corrupt(grid_frame(), rates, CLASSES, np.random.default_rng(s)) for s in (7, 7, 8))
    assert np.array_equal(first.ids, again.ids) and first.masks == again.masks
    assert not np.array_equal(first.ids, other.ids)


def test_every_id_has_a_mask() -> None:
    for frame in repeat(rates_of_level(1.0), 10):
        assert set(np.unique(frame.ids).tolist()) - {0} == set(frame.masks)
