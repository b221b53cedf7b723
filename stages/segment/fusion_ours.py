"""Ours: the thesis's fusion, in which small things that a mask claims stay and segments that masks share are cut."""

from __future__ import annotations

import cv2
import numpy as np
from scenewright.stages.segment.claims import claim_small, claim_unlabelled
from scenewright.stages.segment.fusion import (
    BACKGROUND,
    FusedFrame,
    FusionSettings,
    describe,
    far_from_instance,
    labels_over,
    majority_labels,
    masks_with_depth,
    parts_of_things,
    split_contained,
)
from scenewright.stages.segment.geometric import pixels_at
from scenewright.stages.segment.overlaps import overlap_table, pixels_of_labels
from scenewright.stages.segment.panoptic import PanopticFrame

RIM = 2
"""Largest width of what a mask takes of a neighbour along its outline [pixels at 640 width]."""
REACH_PER_SIZE = 0.5
"""Segments of an instance within this share of its size belong together, but for `LONGEST_REACH`."""
LONGEST_REACH = 0.2
"""Largest distance of segments that belong together by `REACH_PER_SIZE` [m]: the foot of a lamp under its shade."""
REACH_PER_DEPTH = 0.03
"""Segments of an instance within this share of their depth belong together. Sampled points lie a hundredth of
the depth apart, and depth noise grows on top of that: at three metres 5 cm tear a desk into pieces."""


def fuse(
    geometric: np.ndarray,
    panoptic: PanopticFrame,
    points: np.ndarray,
    settings: FusionSettings,
    small: np.ndarray | None = None,
) -> FusedFrame:
    """Return the fused segments of a frame (`FusionRule`)."""
    minimum_pixels = pixels_at(settings.minimum_pixels, geometric.shape)
    if not panoptic.masks:
        large = labels_over(geometric, np.bincount(geometric.ravel()) >= minimum_pixels)
        return describe(large, np.zeros(int(geometric.max(initial=0)) + 1, dtype=np.int64), panoptic)
    panoptic = masks_with_depth(panoptic, points)
    least_claimed = pixels_at(settings.small_object_pixels, geometric.shape)
    fewest = pixels_at(settings.small_object_pixels // 2, geometric.shape)
    labels = without_small(geometric, panoptic, minimum_pixels=minimum_pixels, keep_claimed=least_claimed)
    labels = claim_unlabelled(labels, panoptic.ids, points[..., 2], minimum_pixels=fewest)
    if small is not None:
        labels = claim_small(labels, small, panoptic, minimum_pixels=fewest)
    labels = split_contained(
        labels, panoptic.ids, contained_share=settings.contained_share, largest_part=settings.largest_part
    )
    labels = split_shared(labels, panoptic.ids, minimum_pixels=least_claimed, minimum_share=settings.majority_share)
    owner = majority_labels(labels, panoptic.ids, majority_share=settings.majority_share)
    pixels = pixels_of_labels(labels)
    for of_instance in parts_of_things(owner, panoptic):
        if len(of_instance) > 1:
            instance_pixels = np.concatenate([pixels.of(part) for part in of_instance])
            distance = max(settings.cluster_distance, reach_of(points.reshape(-1, 3)[instance_pixels]))
            owner[far_from_instance(pixels, of_instance, points, distance=distance, step=settings.cluster_step)] = (
                BACKGROUND
            )
    return describe(labels, owner, panoptic)


def without_small(
    geometric: np.ndarray, panoptic: PanopticFrame, *, minimum_pixels: int, keep_claimed: int
) -> np.ndarray:
    """Return geometric labels (H, W) without the segments under `minimum_pixels`.

    A small segment stays when more than half of it lies in one mask of a thing and it has at least `keep_claimed`
    pixels: a cup four metres away is no noise when somebody has recognised it.
    """
    table = overlap_table(geometric, panoptic.ids)
    pixels = table.sum(axis=1)
    things = np.zeros(table.shape[1], dtype=bool)
    things[[i for i, mask in panoptic.masks.items() if mask.is_thing and i < things.size]] = True
    strongest = np.where(things, table, 0).max(axis=1)
    claimed = (strongest > 0.5 * pixels) & (pixels >= keep_claimed)
    return labels_over(geometric, (pixels >= minimum_pixels) | claimed)


def split_shared(
    geometric: np.ndarray, panoptic: np.ndarray, *, minimum_pixels: int, minimum_share: float
) -> np.ndarray:
    """Return geometric labels (H, W) in which segments that several masks share are cut between them.

    A mask beside the strongest one leaves segment G_j when at least `minimum_pixels` of it lie in G_j and they are
    `minimum_share` of G_j or half of the mask, or no mere rim (`has_core`). In the thesis two things
    that touch without a crease (cushions of a sofa, doors of one cabinet front) otherwise become one, as neither mask
    is contained in the segment, and a monitor's foot becomes desk.
    """
    table = overlap_table(geometric, panoptic)
    mask_pixels = table.sum(axis=0)
    result = geometric.copy()
    flat, masks, pixels = result.reshape(-1), panoptic.ravel(), pixels_of_labels(geometric)
    next_label = table.shape[0]
    for j in range(1, table.shape[0]):
        shared = table[j].copy()
        shared[0] = 0
        enough = (shared >= minimum_share * table[j].sum()) | (2 * shared >= mask_pixels)
        for i in np.flatnonzero(shared >= minimum_pixels):
            if i == int(np.argmax(shared)):
                continue
            inside = pixels.of(j)
            part = inside[masks[inside] == i]
            if enough[i] or has_core(part, geometric.shape[1], minimum_pixels):
                flat[part] = next_label
                next_label += 1
    return result


def has_core(region: np.ndarray, image_width: int, minimum_pixels: int) -> bool:
    """Whether at least `minimum_pixels` of a region are farther from its outline than masks err; the region is pixels
    (N,), ascending, of the flattened image."""
    rows, columns = np.divmod(region, image_width)
    cut = np.zeros((rows[-1] - rows[0] + 1, np.ptp(columns) + 1), dtype=np.uint8)
    cut[rows - rows[0], columns - columns.min()] = 1
    width = 2 * max(1, round(RIM * image_width / 640)) + 1
    if np.count_nonzero(cut.any(axis=1)) < width or np.count_nonzero(cut.any(axis=0)) < width:
        return False
    # Beyond the image and the cut there is nothing of the region.
    core = cv2.erode(cut, np.ones((width, width), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return int(np.count_nonzero(core)) >= minimum_pixels


def reach_of(points: np.ndarray) -> float:
    """Return how far apart [m] segments of one instance with points (N, 3) [m] in the camera frame may lie."""
    low, middle, high = np.quantile(points, [0.05, 0.5, 0.95], axis=0)
    size = float(np.linalg.norm(high - low))
    return max(REACH_PER_DEPTH * float(middle[2]), min(LONGEST_REACH, REACH_PER_SIZE * size))
