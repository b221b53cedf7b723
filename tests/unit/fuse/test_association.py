"""Data association by hand: greedy segments (section 2.3.2), instances by the triple-wise count, one rule a test."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.fuse.association import (
    Overlap,
    Prediction,
    associate_instances,
    index_segments,
    match_segments,
    measure_overlap,
    overlapping_labels,
)
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.integration import integrate
from scenewright.stages.fuse.voxel_blocks import VoxelBlocks
from scenewright.stages.kit.geometry.transforms import look_at

from tests.unit.fuse.scenes import CAMERA, SCENE, render

CHAIR, TABLE = 4, 5


def overlap(sizes: list[int], shared: dict[tuple[int, int], int]) -> Overlap:
    rows, labels = np.array(sorted(shared)).reshape(-1, 2).T
    return Overlap(np.array(sizes), rows, labels, np.array([shared[key] for key in sorted(shared)]))


def matched(sizes: list[int], shared: dict[tuple[int, int], int], voxels: int = 8, share: float = 0.1) -> list[int]:
    return match_segments(overlap(sizes, shared), minimum_voxels=voxels, minimum_share=share)


def counted(*triples: tuple[int, int, int, int]) -> TripleCounts:
    counts = TripleCounts()
    for segment, class_id, instance, amount in triples:
        counts.add(segment, class_id, instance, amount)
    return counts


def test_largest_overlap_first_and_a_label_only_once() -> None:
    # Both frame segments lie on label 7; the second lies on it more, so the first takes its second best.
    assert matched([100, 100], {(0, 7): 60, (1, 7): 80, (0, 9): 20}) == [9, 7]


def test_a_segment_without_a_free_label_is_new() -> None:
    assert matched([100, 100], {(0, 7): 60, (1, 7): 80}) == [0, 7]


def test_small_overlaps_and_small_segments() -> None:
    assert matched([100, 7], {(0, 3): 7, (1, 3): 7}) == [0, -1], "under 8 voxels nothing is said"
    assert matched([1000], {(0, 3): 90}) == [0], "under the least share"
    assert matched([1000], {(0, 3): 100}) == [3]


def test_ties_go_to_the_earlier_segment_and_the_older_label() -> None:
    assert matched([50, 50], {(0, 2): 20, (1, 2): 20}) == [2, 0]
    assert matched([50], {(0, 5): 20, (0, 2): 20}) == [2]


def test_no_overlap_at_all() -> None:
    assert matched([50, 3], {}) == [0, -1]


def test_instance_with_the_largest_count_wins() -> None:
    counts = counted((1, CHAIR, 5, 2), (1, CHAIR, 6, 3), (1, TABLE, 9, 50))
    assert associate_instances([Prediction(1, CHAIR, 1)], counts, 10) == ({(1, CHAIR): 6}, 10)


def test_new_instance_where_the_sum_is_zero() -> None:
    counts = counted((1, TABLE, 9, 50), (2, CHAIR, 4, 3))
    assert associate_instances([Prediction(1, CHAIR, 1)], counts, 10) == ({(1, CHAIR): 10}, 11)


def test_all_segments_of_a_frame_instance_get_one_label() -> None:
    # Alone, the seat would say 5 and the back 6; together they say 6. The leg, never seen before, goes with them.
    counts = counted((1, CHAIR, 5, 2), (2, CHAIR, 6, 3))
    seat, back, leg = Prediction(1, CHAIR, 1), Prediction(2, CHAIR, 1), Prediction(3, CHAIR, 1)
    assert associate_instances([seat, back, leg], counts, 10) == ({(1, CHAIR): 6}, 10)
    counts.add(1, CHAIR, 6, 1)
    counts.add(1, CHAIR, 5, 4)
    assert associate_instances([seat, back, leg], counts, 10) == ({(1, CHAIR): 5}, 10), "6 against 3 + 1"


def test_two_instances_of_a_frame_never_share_a_label() -> None:
    counts = counted((1, CHAIR, 5, 3), (2, CHAIR, 5, 2), (2, CHAIR, 6, 1))
    predictions = [Prediction(1, CHAIR, 1), Prediction(2, CHAIR, 2)]
    assert associate_instances(predictions, counts, 10) == ({(1, CHAIR): 5, (2, CHAIR): 6}, 10)
    only_one = counted((1, CHAIR, 5, 2), (2, CHAIR, 5, 3))
    assert associate_instances(predictions, only_one, 10) == ({(2, CHAIR): 5, (1, CHAIR): 10}, 11)


def test_nothing_predicted_nothing_made() -> None:
    assert associate_instances([], TripleCounts(), 4) == ({}, 4)


def test_ids_become_indices() -> None:
    ids = np.array([[0, 70000, 70000], [5, 5, 0]], dtype=np.int32)
    image, unlisted = index_segments(ids, np.array([5, 70000], dtype=np.int32))
    assert image.tolist() == [[0, 2, 2], [1, 1, 0]] and unlisted == -1
    image, unlisted = index_segments(ids, np.array([5], dtype=np.int32))
    assert image.tolist() == [[0, 0, 0], [1, 1, 0]] and unlisted == 70000


@pytest.mark.parametrize("stride", [1, 2])
def test_overlap_counts_distinct_voxels(stride: int) -> None:
    pose = look_at(np.array([0.3, -1.4, 1.2]), np.array([0.0, 0.0, 0.4]))
    depth, image = render(SCENE, pose)
    index_image = image.astype(np.uint16)
    blocks = VoxelBlocks(0.02)
    label_of_index = np.array([0, 4, 3, 2, 1], dtype=np.int32)
    canonical = np.array([0, 1, 2, 3, 3], dtype=np.int32)  # label 4 was merged into 3
    options = {"canonical": canonical, "near": 0.1, "far": 4.0, "stride": stride}
    empty = measure_overlap(blocks, depth, index_image, 4, CAMERA, pose, **options)
    assert len(empty.rows) == 0 and (empty.sizes > 0).all()
    integrate(
        blocks,
        depth,
        CAMERA,
        pose,
        truncation=0.08,
        near=0.1,
        far=4.0,
        index_image=index_image,
        label_of_index=label_of_index,
        canonical=np.arange(5, dtype=np.int32),
    )
    found = measure_overlap(blocks, depth, index_image, 4, CAMERA, pose, **options)
    # The same by sets of voxel coordinates.
    rows, columns = np.mgrid[stride // 2 : CAMERA.height : stride, stride // 2 : CAMERA.width : stride]
    z = depth[rows, columns].astype(float)
    points = np.stack([(columns - CAMERA.cx) / CAMERA.fx * z, (rows - CAMERA.cy) / CAMERA.fy * z, z], axis=-1)
    voxels = np.floor((points @ pose[:3, :3].T + pose[:3, 3]) / 0.02).astype(int)
    for number in range(1, 5):
        inside = (image[rows, columns] == number) & (z > 0) & (z <= 4.0)
        assert found.sizes[number - 1] == len(np.unique(voxels[inside], axis=0))
    labels = {int(r): set(found.labels[found.rows == r].tolist()) for r in range(4)}
    assert 3 in labels[0] and 4 not in set(found.labels.tolist()), "labels are those they were merged into"
    cup = dict(zip(found.labels[found.rows == 2].tolist(), found.counts[found.rows == 2].tolist(), strict=True))
    assert max(cup, key=lambda label: cup[label]) == 2
    assert cup[2] >= 0.9 * found.sizes[2]


def test_labels_that_fill_enough_of_a_segment() -> None:
    found = overlap([100, 50], {(0, 3): 30, (0, 5): 19, (0, 8): 20, (1, 5): 50})
    assert list(overlapping_labels(found, 0.2)) == [[3, 8], [5]]
