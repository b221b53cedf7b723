"""Which global segment and which global instance a frame's segments belong to (Han 2024, section 2.3.2)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.integration import intrinsics_of
from scenewright.stages.fuse.voxel_blocks import SIDE, VoxelBlocks, find, mix, pack
from scenewright.stages.kit.compiled import compiled


@dataclass(frozen=True)
class Overlap:
    """How a frame's segments lie in the map, in distinct voxels.

    `sizes` (K,) int64: voxels under each frame segment's points, mapped or not. `rows`, `labels`, `counts` (N,): frame
    segment, global label, shared voxels; only positive counts, sorted by (row, label).
    """

    sizes: np.ndarray
    rows: np.ndarray
    labels: np.ndarray
    counts: np.ndarray


@compiled
def index_segments(ids: np.ndarray, sorted_ids: np.ndarray) -> tuple[np.ndarray, int]:
    """Replace the ids (H, W) int32 of a frame by 1 + their place in sorted_ids (K,) int32; 0 stays 0.

    Returns the (H, W) uint16 image and some id that is not in the list, or -1.
    """
    height, width = ids.shape
    result = np.zeros((height, width), dtype=np.uint16)
    unlisted = -1
    for row in range(height):
        last_id, last_index = 0, 0
        for column in range(width):
            value = ids[row, column]
            if value != last_id:
                last_id = value
                sorted_index = np.searchsorted(sorted_ids, value)
                if value == 0:
                    last_index = 0
                elif sorted_index < sorted_ids.shape[0] and sorted_ids[sorted_index] == value:
                    last_index = sorted_index + 1
                else:
                    last_index = 0
                    unlisted = value
            result[row, column] = last_index
    return result, unlisted


@compiled(nogil=True)
def _sample_voxels(
    depth: np.ndarray,
    index_image: np.ndarray,
    intrinsics: np.ndarray,
    world_from_camera: np.ndarray,
    stride: int,
    near: float,
    far: float,
    voxel_size: float,
    keys: np.ndarray,
    slots: np.ndarray,
    segment: np.ndarray,
    canonical: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return frame segment index and global label (0: none) of every distinct (segment, voxel) under the points."""
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    samples = ((height + stride - 1) // stride) * ((width + stride - 1) // stride)
    size = 16
    while 2 * size < 3 * samples:  # neighbouring samples share voxels: it never gets near full
        size *= 2
    seen_key = np.full(size, -1, dtype=np.int64)
    seen_row = np.zeros(size, dtype=np.uint16)
    rows = np.empty(samples, dtype=np.int64)
    labels = np.empty(samples, dtype=np.int64)
    count = 0
    last_key, last_index, last_block, slot = -1, 0, -1, -1
    # A pixel's point in voxels is z * (column * step + start) + eye.
    eye = world_from_camera[:3, 3] / voxel_size
    step = world_from_camera[:3, 0] / (fx * voxel_size)
    for row in range(stride // 2, height, stride):
        start = world_from_camera[:3, 1] * ((row - cy) / (fy * voxel_size)) + world_from_camera[:3, 2] / voxel_size
        start -= step * cx
        for column in range(stride // 2, width, stride):
            index = index_image[row, column]
            z = depth[row, column]
            if index == 0 or not (near <= z <= far):
                continue
            i = int(np.floor(z * (column * step[0] + start[0]) + eye[0]))
            j = int(np.floor(z * (column * step[1] + start[1]) + eye[1]))
            k = int(np.floor(z * (column * step[2] + start[2]) + eye[2]))
            key = pack(i, j, k)
            if key == last_key and index == last_index:
                continue
            last_key, last_index = key, index
            hash_slot = mix(key, size - 1)
            is_repeated = False
            while seen_key[hash_slot] != -1:
                if seen_key[hash_slot] == key and seen_row[hash_slot] == index:
                    is_repeated = True
                    break
                hash_slot = (hash_slot + 1) & (size - 1)
            if is_repeated:
                continue
            seen_key[hash_slot] = key
            seen_row[hash_slot] = index
            block = pack(i // SIDE, j // SIDE, k // SIDE)
            if block != last_block:
                last_block = block
                slot = find(keys, slots, block)
            rows[count] = index - 1
            labels[count] = 0
            if slot >= 0:
                labels[count] = canonical[segment[slot, (i % SIDE) + SIDE * (j % SIDE) + SIDE * SIDE * (k % SIDE)]]
            count += 1
    return rows[:count], labels[:count]


def measure_overlap(
    blocks: VoxelBlocks,
    depth: np.ndarray,
    index_image: np.ndarray,
    segment_count: int,
    camera: Camera,
    world_from_camera: np.ndarray,
    *,
    canonical: np.ndarray,
    near: float,
    far: float,
    stride: int = 2,
) -> Overlap:
    """Count the voxels that each frame segment shares with each global segment label.

    index_image (H, W) uint16 holds 1 + the number of the frame segment, 0 for none; every `stride`-th row and column
    of depth (H, W) float32 [m] is looked at. `canonical` (int32) tells which label each label was merged into.
    """
    rows, labels = _sample_voxels(
        np.ascontiguousarray(depth, dtype=np.float32),
        index_image,
        intrinsics_of(camera),
        np.ascontiguousarray(world_from_camera, dtype=np.float64),
        stride,
        near,
        far,
        blocks.voxel_size,
        blocks.keys,
        blocks.slots,
        blocks.segment,
        canonical,
    )
    sizes = np.bincount(rows, minlength=segment_count)
    # Only labels that are in sight get a column: a table of all labels of the map would grow with it.
    present = np.flatnonzero(np.bincount(labels, minlength=1))
    column_of = np.zeros(len(canonical), dtype=np.int64)
    column_of[present] = np.arange(len(present))
    width = len(present)
    table = np.bincount(rows * width + column_of[labels], minlength=segment_count * width)
    table = table.reshape(segment_count, width)
    table[:, present == 0] = 0  # voxels without a label
    pair_rows, columns = np.nonzero(table)
    return Overlap(sizes, pair_rows, present[columns], table[pair_rows, columns])


def match_segments(overlap: Overlap, *, minimum_voxels: int, minimum_share: float) -> list[int]:
    """Return the global segment label of each frame segment: 0 where a new label is due, -1 where it is too small.

    Greedy (section 2.3.2): the pair with the largest overlap first; a label goes to one frame segment at most. Pairs
    under `minimum_voxels`, or under `minimum_share` of the frame segment, are no match; segments of fewer voxels than
    `minimum_voxels` take no part. Ties go to the earlier frame segment, then to the older label.
    """
    result = [0 if size >= minimum_voxels else -1 for size in overlap.sizes]
    used: set[int] = set()
    pairs = zip(overlap.counts.tolist(), overlap.rows.tolist(), overlap.labels.tolist(), strict=True)
    for count, row, label in sorted(pairs, key=lambda pair: (-pair[0], pair[1], pair[2])):
        enough = count >= minimum_voxels and count >= minimum_share * overlap.sizes[row]
        if enough and result[row] == 0 and label not in used:
            result[row] = label
            used.add(label)
    return result


@dataclass(frozen=True)
class Prediction:
    """A frame segment that was matched: global label l, class c_k, instance o_k within the frame."""

    segment: int
    class_id: int
    frame_instance: int
    score: float = 1.0


def associate_instances(
    predictions: Sequence[Prediction], counts: TripleCounts, next_instance: int
) -> tuple[dict[tuple[int, int], int], int]:
    """Return {(frame instance, class): global instance} and the next unused global instance label.

    The segments of a frame instance o vote together: p = argmax of the sum over its segments of Phi(l, c, p) > 0, which
    for a single segment is the thesis's rule, and gives all its segments one label ("prevent assigning multiple
    labels"). Two instances of one frame never get the same global label: the larger sum chooses first. Where no sum is
    positive, a new label is made.
    """
    keys = sorted({(p.frame_instance, p.class_id) for p in predictions})
    sums: dict[tuple[tuple[int, int], int], int] = {}
    for prediction in predictions:
        key = (prediction.frame_instance, prediction.class_id)
        for instance, count in counts.instances(prediction.segment, prediction.class_id).items():
            sums[key, instance] = sums.get((key, instance), 0) + count
    result: dict[tuple[int, int], int] = {}
    used: set[int] = set()
    for key, instance in sorted(sums, key=lambda pair: (-sums[pair], pair)):
        if key not in result and instance not in used:
            result[key] = instance
            used.add(instance)
    for key in keys:
        if key not in result:
            result[key] = next_instance
            next_instance += 1
    return result, next_instance


def overlapping_labels(overlap: Overlap, minimum_share: float) -> Iterable[list[int]]:
    """Yield, for each frame segment, the global labels that fill at least `minimum_share` of it, ascending."""
    for row in range(len(overlap.sizes)):
        inside = overlap.rows == row
        enough = overlap.counts[inside] >= minimum_share * overlap.sizes[row]
        yield overlap.labels[inside][enough].tolist()
