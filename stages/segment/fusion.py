"""Fusion of panoptic masks M_i with geometric segments G_j into the segments (P_k, c_k, o_k) of a frame.

Han 2024, section 2.3.1: geometric segments under a size are discarded; one that fully contains a panoptic mask is
split; every segment takes the label of the mask that covers most of it; the segments of an instance that lie far from
its largest Euclidean cluster go to the background. The thresholds are those of the published system.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scenewright.schemas.segments import Witness
from scenewright.stages.segment.clustering import largest_cluster
from scenewright.stages.segment.geometric import relabel
from scenewright.stages.segment.overlaps import LabelPixels, overlap_table, pixels_of_labels
from scenewright.stages.segment.panoptic import PanopticFrame

BACKGROUND = 0
"""Owner of geometric segments that no mask claims."""


@dataclass(frozen=True)
class FusionSettings:
    """Thresholds; see stages/segment/parameters.py for their meaning."""

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
    class_id: int
    instance: int
    is_thing: bool
    score: float
    area: int
    witnesses: tuple[Witness, ...] = ()


@dataclass(frozen=True)
class FusedFrame:
    """Fused segments of one frame: `ids` (H, W) int32, 0 = void, and the segments in order of their id."""

    ids: np.ndarray
    segments: tuple[FusedSegment, ...]


class FusionRule(Protocol):
    """One way of fusing. The table of rules is in stage.py."""

    def __call__(
        self,
        geometric: np.ndarray,
        panoptic: PanopticFrame,
        points: np.ndarray,
        settings: FusionSettings,
        small: np.ndarray | None = None,
    ) -> FusedFrame:
        """Return the fused segments of a frame.

        `geometric` (H, W) int32 labels, 0 = none; `points` (H, W, 3) [m] in the camera frame; `small` (H, W) regions
        under the least segment size, for rules that look at them. Pixels without a geometric segment (no depth, or
        discarded) are void. Segments without a label have category 0 and instance 0.
        """
        ...


def masks_with_depth(panoptic: PanopticFrame, points: np.ndarray) -> PanopticFrame:
    """Return the masks without their pixels that have no depth: those can be in no segment."""
    return PanopticFrame(np.where(points[..., 2] > 0, panoptic.ids, 0).astype(np.int32), panoptic.masks)


def labels_over(geometric: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """Return the labels (H, W) of which `keep` (n + 1,) is true; the others become 0."""
    keep[0] = True
    return np.where(keep, np.arange(keep.size), 0).astype(np.int32)[geometric]


def parts_of_things(owner: np.ndarray, panoptic: PanopticFrame) -> Iterator[list[int]]:
    """Yield the labels that each mask of a thing owns. A stuff class is one "instance" all over the room: distance
    says nothing about it."""
    for mask_id, mask in sorted(panoptic.masks.items()):
        if mask.is_thing:
            yield [int(label) for label in np.flatnonzero(owner == mask_id)]


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
    flat, masks, pixels = result.reshape(-1), panoptic.ravel(), pixels_of_labels(geometric)
    next_label = table.shape[0]
    for j in range(1, table.shape[0]):
        for i in np.flatnonzero(table[j, 1:]) + 1:
            shared = table[j, i]
            if shared > contained_share * mask_pixels[i] and shared < largest_part * segment_pixels[j]:
                inside = pixels.of(j)
                flat[inside[masks[inside] == i]] = next_label
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


def far_from_instance(
    pixels: LabelPixels, segments: list[int], points: np.ndarray, *, distance: float, step: int
) -> list[int]:
    """Return those of the `segments` of one instance that are not in its largest Euclidean cluster.

    `pixels` of the labels; `points` (H, W, 3) [m]; two segments are neighbours when any of their points (every
    `step`-th is looked at) come within `distance` [m]; the largest cluster has the most points (Han 2024, section
    2.3.1).
    """
    if len(segments) < 2:
        return []
    flat = points.reshape(-1, 3)
    in_cluster = largest_cluster(
        [flat[pixels.of(label)[::step]] for label in segments],
        [len(pixels.of(label)) for label in segments],
        distance=distance,
    )
    return [label for index, label in enumerate(segments) if index not in in_cluster]


def describe(labels: np.ndarray, owner: np.ndarray, panoptic: PanopticFrame) -> FusedFrame:
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
        segments.append(
            FusedSegment(label, mask.class_id, instance, mask.is_thing, mask.score, int(areas[label]), mask.witnesses)
        )
    return FusedFrame(ids=ids, segments=tuple(segments))
