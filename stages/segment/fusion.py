"""Fusion of panoptic masks M_i with geometric segments G_j into the segments (P_k, c_k, o_k) of a frame.

Han 2024, section 2.3.1: geometric segments under a size are discarded; one that fully contains a panoptic mask is
split; every segment takes the label of the mask that covers most of it; the segments of an instance that lie far from
its largest Euclidean cluster go to the background. The thresholds are those of the published system.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from stages.segment.claims import claim_small, claim_unlabelled
from stages.segment.clustering import largest_cluster
from stages.segment.geometric import pixels_at, relabel
from stages.segment.overlaps import overlap_table
from stages.segment.panoptic import PanopticFrame

BACKGROUND = 0
RIM = 2
"""Ours: what a mask takes of a neighbour along its outline is this wide at most [pixels at 640 width]."""
REACH_PER_SIZE = 0.5
"""Ours: segments of an instance within this share of its size belong together, ..."""
LONGEST_REACH = 0.2
"""... up to this distance [m]: the foot of a lamp under its shade."""
REACH_PER_DEPTH = 0.03
"""Ours: segments of an instance within this share of their depth belong together. Sampled points lie a hundredth of
the depth apart, and depth noise grows on top of that: at three metres 5 cm tear a desk into pieces."""


@dataclass(frozen=True)
class FusionSettings:
    """Thresholds; see stages/segment/parameters.py for their meaning."""

    rule: Literal["thesis", "ours", "voxblox++"] = "ours"
    minimum_pixels: int = 800
    contained_share: float = 0.9
    largest_part: float = 0.5
    majority_share: float = 0.2
    cluster_distance: float = 0.05
    cluster_step: int = 5
    small_object_pixels: int = 60


@dataclass(frozen=True)
class FusedSegment:
    """What a fused segment is; its number is its value in FusedFrame.ids."""

    id: int
    category_id: int
    instance: int
    is_thing: bool
    score: float
    area: int


@dataclass(frozen=True)
class FusedFrame:
    """Fused segments of one frame: `ids` (H, W) int32, 0 = void, and the segments in order of their id."""

    ids: np.ndarray
    segments: tuple[FusedSegment, ...]


def split_contained(
    geometric: np.ndarray, panoptic: np.ndarray, *, contained_share: float, largest_part: float
) -> np.ndarray:
    """Return geometric labels (H, W) in which panoptic masks are split out of the segments that contain them.

    Mask M_i leaves segment G_j when more than `contained_share` of M_i's pixels with depth segments lies in G_j and
    it is less than `largest_part` of G_j (Han 2024, section 2.3.1; a mask that nearly fills G_j *is* G_j). New
    segments get the labels after the last one, in order of (j, i).
    """
    table = overlap_table(geometric, panoptic)
    mask_pixels = np.bincount(panoptic.ravel(), minlength=table.shape[1])
    segment_pixels = table.sum(axis=1)
    result = geometric.copy()
    next_label = table.shape[0]
    for j in range(1, table.shape[0]):
        for i in np.flatnonzero(table[j, 1:]) + 1:
            shared = table[j, i]
            if shared > contained_share * mask_pixels[i] and shared < largest_part * segment_pixels[j]:
                result[(geometric == j) & (panoptic == i)] = next_label
                next_label += 1
    return result


def majority_labels(geometric: np.ndarray, panoptic: np.ndarray, *, majority_share: float) -> np.ndarray:
    """Return the panoptic id (n + 1,) of every geometric label: the mask that covers most of its pixels, if that is
    at least `majority_share` of them, else 0 (background). Ties go to the smaller id."""
    table = overlap_table(geometric, panoptic)
    best = np.zeros(table.shape[0], dtype=np.int64)
    if table.shape[1] > 1:
        winner = 1 + np.argmax(table[:, 1:], axis=1)
        enough = table[np.arange(table.shape[0]), winner] >= majority_share * np.maximum(table.sum(axis=1), 1)
        best = np.where(enough, winner, 0)
    best[0] = 0
    return best


def split_shared(
    geometric: np.ndarray, panoptic: np.ndarray, *, minimum_pixels: int, minimum_share: float
) -> np.ndarray:
    """Return geometric labels (H, W) in which segments that several masks share are cut between them.

    A mask beside the strongest one leaves segment G_j when at least `minimum_pixels` of it lie in G_j and they are
    `minimum_share` of G_j or half of the mask, or no mere rim (`has_core`). This is ours, not the thesis's: two things
    that touch without a crease (cushions of a sofa, doors of one cabinet front) otherwise become one, as neither mask
    is contained in the segment, and a monitor's foot becomes desk.
    """
    table = overlap_table(geometric, panoptic)
    mask_pixels = table.sum(axis=0)
    result = geometric.copy()
    next_label = table.shape[0]
    for j in range(1, table.shape[0]):
        shared = table[j].copy()
        shared[0] = 0
        enough = (shared >= minimum_share * table[j].sum()) | (2 * shared >= mask_pixels)
        for i in np.flatnonzero(shared >= minimum_pixels):
            if i == int(np.argmax(shared)):
                continue
            part = (geometric == j) & (panoptic == i)
            if enough[i] or has_core(part, minimum_pixels):
                result[part] = next_label
                next_label += 1
    return result


def has_core(region: np.ndarray, minimum_pixels: int) -> bool:
    """Whether at least `minimum_pixels` of a region (H, W) bool are farther from its outline than masks err."""
    rows, columns = np.flatnonzero(region.any(axis=1)), np.flatnonzero(region.any(axis=0))
    width = 2 * max(1, round(RIM * region.shape[1] / 640)) + 1
    if len(rows) < width or len(columns) < width:
        return False
    cut = region[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(np.uint8)
    # Beyond the image and the cut there is nothing of the region.
    core = cv2.erode(cut, np.ones((width, width), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return int(np.count_nonzero(core)) >= minimum_pixels


def without_small(
    geometric: np.ndarray, panoptic: PanopticFrame, *, minimum_pixels: int, keep_claimed: int | None
) -> np.ndarray:
    """Return geometric labels (H, W) without the segments under `minimum_pixels`.

    With `keep_claimed`, a small segment stays when more than half of it lies in one mask of a thing and it has at
    least that many pixels: a cup four metres away is no noise when somebody has recognised it. None is the thesis.
    """
    table = overlap_table(geometric, panoptic.ids)
    pixels = table.sum(axis=1)
    keep = pixels >= minimum_pixels
    if keep_claimed is not None:
        things = np.zeros(table.shape[1], dtype=bool)
        things[[i for i, mask in panoptic.masks.items() if mask.is_thing and i < things.size]] = True
        strongest = np.where(things, table, 0).max(axis=1)
        keep |= (strongest > 0.5 * pixels) & (pixels >= keep_claimed)
    keep[0] = True
    return np.where(keep, np.arange(keep.size), 0).astype(np.int32)[geometric]


def far_from_instance(
    labels: np.ndarray, segments: list[int], points: np.ndarray, *, distance: float, step: int
) -> list[int]:
    """Return those of the `segments` of one instance that are not in its largest Euclidean cluster.

    `labels` (H, W); `points` (H, W, 3) [m]; two segments are neighbours when any of their points (every `step`-th
    is looked at) come within `distance` [m]; the largest cluster has the most points (Han 2024, section 2.3.1).
    """
    if len(segments) < 2:
        return []
    flat = labels.ravel()
    clouds, sizes = [], []
    for label in segments:
        pixels = np.flatnonzero(flat == label)
        sizes.append(pixels.size)
        clouds.append(points.reshape(-1, 3)[pixels[::step]])
    kept = largest_cluster(clouds, sizes, distance=distance)
    return [label for index, label in enumerate(segments) if index not in kept]


def reach_of(points: np.ndarray) -> float:
    """Return how far apart [m] segments of one instance with points (N, 3) [m] in the camera frame may lie."""
    low, middle, high = np.quantile(points, [0.05, 0.5, 0.95], axis=0)
    size = float(np.linalg.norm(high - low))
    return max(REACH_PER_DEPTH * float(middle[2]), min(LONGEST_REACH, REACH_PER_SIZE * size))


def fuse(
    geometric: np.ndarray,
    panoptic: PanopticFrame,
    points: np.ndarray,
    settings: FusionSettings,
    small: np.ndarray | None = None,
) -> FusedFrame:
    """Return the fused segments of a frame (Han 2024, section 2.3.1).

    `geometric` (H, W) int32 labels, 0 = none; `points` (H, W, 3) [m] in the camera frame; `small` (H, W) regions under
    the least segment size, which only `ours` looks at. Pixels without a geometric
    segment (no depth, or discarded) are void. Segments without a label have category 0 and instance 0.
    """
    if settings.rule == "voxblox++":
        # Grinvald 2019: every geometric segment takes one mask; masks that no segment follows are lost.
        return _describe(
            geometric, majority_labels(geometric, panoptic.ids, majority_share=settings.majority_share), panoptic
        )
    thesis = settings.rule == "thesis"
    # A mask is judged by its points: pixels of it without depth can be in no segment.
    panoptic = PanopticFrame(np.where(points[..., 2] > 0, panoptic.ids, 0).astype(np.int32), panoptic.masks)
    labels = without_small(
        geometric,
        panoptic,
        minimum_pixels=pixels_at(settings.minimum_pixels, geometric.shape),
        keep_claimed=None if thesis else pixels_at(settings.small_object_pixels, geometric.shape),
    )
    if not thesis:
        fewest = pixels_at(settings.small_object_pixels // 2, labels.shape)
        labels = claim_unlabelled(labels, panoptic.ids, points[..., 2], minimum_pixels=fewest)
        if small is not None:
            labels = claim_small(labels, small, panoptic, minimum_pixels=fewest)
    labels = split_contained(
        labels, panoptic.ids, contained_share=settings.contained_share, largest_part=settings.largest_part
    )
    if not thesis:
        labels = split_shared(
            labels,
            panoptic.ids,
            minimum_pixels=pixels_at(settings.small_object_pixels, labels.shape),
            minimum_share=settings.majority_share,
        )
    owner = majority_labels(labels, panoptic.ids, majority_share=settings.majority_share)
    for mask_id, mask in sorted(panoptic.masks.items()):
        if not mask.is_thing:
            continue  # A stuff class is one "instance" all over the room: distance says nothing about it.
        parts = [int(label) for label in np.flatnonzero(owner == mask_id)]
        distance, step = settings.cluster_distance, settings.cluster_step
        if not thesis and parts:
            distance = max(distance, reach_of(points[np.isin(labels, parts)]))
        owner[far_from_instance(labels, parts, points, distance=distance, step=step)] = BACKGROUND
    return _describe(labels, owner, panoptic)


def _describe(labels: np.ndarray, owner: np.ndarray, panoptic: PanopticFrame) -> FusedFrame:
    """Number the fused segments 1..k and the instances 1..n in order of first appearance, row by row."""
    ids = relabel(labels)
    count = int(ids.max(initial=0))
    areas = np.bincount(ids.ravel(), minlength=count + 1)
    source = np.zeros(count + 1, dtype=np.int64)
    source[ids.ravel()] = labels.ravel()
    instances: dict[int, int] = {}
    segments = []
    for label in range(1, count + 1):
        mask_id = int(owner[source[label]])
        if mask_id == BACKGROUND:
            segments.append(FusedSegment(label, 0, 0, False, 0.0, int(areas[label])))
            continue
        mask = panoptic.masks[mask_id]
        instance = instances.setdefault(mask_id, len(instances) + 1)
        segments.append(FusedSegment(label, mask.category_id, instance, mask.is_thing, mask.score, int(areas[label])))
    return FusedFrame(ids=ids, segments=tuple(segments))
