"""From the segments that a network found, with its own labels, to panoptic masks with classes of the vocabulary."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.kit.labels import Label
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask

KEPT_SHARE = 0.5
"""An instance of which others leave less than this says nothing of its own (Kirillov et al. 2019)."""
SAME_OVERLAP = 0.6
"""IoU of two masks over which they are two answers for one thing."""


@dataclass(frozen=True)
class NamedSegment:
    """What a network says of one segment."""

    label: Label
    score: float
    """0..1."""


@dataclass(frozen=True)
class InstanceMask:
    """One instance of an instance segmentation; these may overlap."""

    mask: np.ndarray
    """(H, W) bool."""
    label: Label
    score: float


def name_segments(
    ids: np.ndarray, segments: Mapping[int, NamedSegment], vocabulary: Vocabulary, *, minimum_pixels: int
) -> PanopticFrame:
    """Return panoptic masks, numbered 1..n, from an id image (H, W) and what its ids are; ids not listed are void.

    Labels without a class are void. All of a stuff class becomes one mask (every wall is the wall), with the best of
    the scores. Where a label is stuff and its class is a thing (COCO's `cabinet-merged`), each connected region
    (8 neighbours) of at least `minimum_pixels` is an instance.
    """
    numbers = np.zeros(ids.shape, dtype=np.int32)
    masks: dict[int, PanopticMask] = {}
    stuff: dict[int, int] = {}
    for segment_id in sorted(segments):
        segment = segments[segment_id]
        pixels = ids == segment_id
        if not segment.label.class_name or not pixels.any():
            continue
        semantic = vocabulary.by_name(segment.label.class_name)
        if semantic.kind == "stuff":
            number = stuff.setdefault(semantic.id, len(masks) + 1)
            best = max(segment.score, masks[number].score if number in masks else 0.0)
            masks[number] = PanopticMask(semantic.id, False, best)
            numbers[pixels] = number
            continue
        regions = _regions(pixels, minimum_pixels) if segment.label.kind == "stuff" else [pixels]
        for region in regions:
            masks[len(masks) + 1] = PanopticMask(semantic.id, True, segment.score)
            numbers[region] = len(masks)
    return PanopticFrame(numbers, masks)


def name_instances(
    instances: Iterable[InstanceMask], shape: tuple[int, int], vocabulary: Vocabulary, *, minimum_pixels: int
) -> PanopticFrame:
    """Return panoptic masks from instance masks that may overlap.

    Of masks that are the same (IoU over SAME_OVERLAP) the best scored stays. Then smaller ones lie over larger ones:
    the cup on the table is in front of it, whichever of the two the network is surer of. What keeps less than half of
    its mask, or less than `minimum_pixels`, is dropped.
    """
    distinct: list[InstanceMask] = []
    for instance in sorted(instances, key=lambda item: -item.score):
        if instance.mask.any() and not any(_are_same(instance.mask, other.mask) for other in distinct):
            distinct.append(instance)
    ids = np.zeros(shape, dtype=np.int32)
    sizes = [int(instance.mask.sum()) for instance in distinct]
    order = sorted(range(len(distinct)), key=lambda k: (-sizes[k], k))
    for number, k in enumerate(order, start=1):
        ids[distinct[k].mask] = number
    visible = np.bincount(ids.ravel(), minlength=len(order) + 1)
    segments = {
        number: NamedSegment(distinct[k].label, distinct[k].score)
        for number, k in enumerate(order, start=1)
        if visible[number] >= max(minimum_pixels, KEPT_SHARE * sizes[k])
    }
    return name_segments(ids, segments, vocabulary, minimum_pixels=minimum_pixels)


def _are_same(first: np.ndarray, second: np.ndarray) -> bool:
    shared = np.count_nonzero(first & second)
    return bool(shared > SAME_OVERLAP * (np.count_nonzero(first) + np.count_nonzero(second) - shared))


def _regions(pixels: np.ndarray, minimum_pixels: int) -> list[np.ndarray]:
    count, numbers, facts, _ = cv2.connectedComponentsWithStats(pixels.astype(np.uint8), connectivity=8)
    return [numbers == k for k in range(1, count) if facts[k, cv2.CC_STAT_AREA] >= minimum_pixels]
