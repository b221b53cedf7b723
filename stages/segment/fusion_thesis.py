"""The fusion as the thesis words it (Han 2024, section 2.3.1). Whoever corrects something does it in fusion_ours.py."""

from __future__ import annotations

import numpy as np
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


def fuse(
    geometric: np.ndarray,
    panoptic: PanopticFrame,
    points: np.ndarray,
    settings: FusionSettings,
    small: np.ndarray | None = None,
) -> FusedFrame:
    """Return the fused segments of a frame: small segments go, contained masks are split out, far parts are background
    (`FusionRule`)."""
    panoptic = masks_with_depth(panoptic, points)
    least = pixels_at(settings.minimum_pixels, geometric.shape)
    labels = labels_over(geometric, overlap_table(geometric, panoptic.ids).sum(axis=1) >= least)
    labels = split_contained(
        labels, panoptic.ids, contained_share=settings.contained_share, largest_part=settings.largest_part
    )
    owner = majority_labels(labels, panoptic.ids, majority_share=settings.majority_share)
    pixels = pixels_of_labels(labels)
    for of_instance in parts_of_things(owner, panoptic):
        far = far_from_instance(
            pixels, of_instance, points, distance=settings.cluster_distance, step=settings.cluster_step
        )
        owner[far] = BACKGROUND
    return describe(labels, owner, panoptic)
