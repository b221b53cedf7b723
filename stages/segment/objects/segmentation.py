"""Class-agnostic objects of one RGB-D frame: what stands on the support surfaces, cut into patches, put together."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from schemas.scene_parts import Camera
from stages.segment.geometric import pixels_at, relabel
from stages.segment.objects.boosting import NO_TREES, Trees
from stages.segment.objects.cuts import CutSettings, cut_patches
from stages.segment.objects.grouping import Recording, group_patches
from stages.segment.objects.patches import PatchFrame, PatchSettings, find_patches
from stages.segment.objects.regions import lab_image, measure_regions
from stages.segment.objects.support import SupportSettings

UP_WITHOUT_SURFACE = np.array([0.0, -1.0, 0.0])
"""Where no support surface is seen, the camera is taken to be upright."""


@dataclass(frozen=True)
class ObjectSettings:
    """Constants of the object segmentation; pixel counts hold for 640x480."""

    patches: PatchSettings = field(default_factory=PatchSettings)
    support: SupportSettings = field(default_factory=SupportSettings)
    cuts: CutSettings = field(default_factory=CutSettings)
    threshold: float = 0.0
    """Pairs with a higher score are joined."""
    minimum_pixels: int = 250
    """Smaller objects are dropped."""
    largest_hole: int = 600
    """Holes in an object up to this many pixels are closed where there is depth."""


@dataclass(frozen=True)
class ObjectFrame:
    """Objects of one frame."""

    labels: np.ndarray
    """(H, W) int32: 0 support surface or nothing, else the object, 1..n."""
    patches: PatchFrame


def segment_objects(
    color: np.ndarray,
    depth: np.ndarray,
    camera: Camera,
    settings: ObjectSettings | None = None,
    trees: Trees = NO_TREES,
    recording: Recording | None = None,
) -> ObjectFrame:
    """Return the objects of a frame: RGB (H, W, 3) uint8 and z-depth (H, W) [m], 0 invalid, in the same pixels.

    `trees` decide which patches are one object; without them the hand-set rules do. Raises ValueError when the shapes
    do not match the camera.
    """
    settings = settings or ObjectSettings()
    if depth.shape != (camera.height, camera.width) or color.shape != (*depth.shape, 3):
        raise ValueError(f"color {color.shape} and depth {depth.shape} do not match {camera.height} x {camera.width}")
    patches = find_patches(depth, camera, settings.patches, settings.support)
    up = patches.supports[0].normal if patches.supports else UP_WITHOUT_SURFACE
    lab = lab_image(color)
    pieces, patch_of = cut_patches(patches.labels, patches.points, patches.normals, lab, up, camera.fx, settings.cuts)
    regions = measure_regions(
        pieces,
        patch_of,
        patches.points,
        patches.normals,
        patches.inverse,
        patches.height,
        lab,
        up,
        jump=settings.patches.jump,
    )
    group_of = group_patches(regions, pieces, patches.inverse, trees, settings.threshold, recording)
    labels = group_of[pieces].astype(np.int32)
    labels = _holes_closed(labels, depth > 0, pixels_at(settings.largest_hole, depth.shape))
    large = np.bincount(labels.ravel()) >= pixels_at(settings.minimum_pixels, depth.shape)
    large[0] = False
    return ObjectFrame(relabel(np.where(large[labels], labels, 0).astype(np.int32)), patches)


def _holes_closed(labels: np.ndarray, valid: np.ndarray, largest: int) -> np.ndarray:
    """Give pixels that one object surrounds to it: (H, W) int32 labels, where `valid`, holes up to `largest` pixels."""
    count, holes, statistics, _ = cv2.connectedComponentsWithStats((labels == 0).astype(np.uint8), connectivity=4)
    owner = np.zeros(count, dtype=np.int32)
    mixed = np.zeros(count, dtype=bool)
    mixed[0] = True
    for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        for hole_side, object_side in ((first, second), (second, first)):
            touching = (labels[hole_side] == 0) & (labels[object_side] > 0)
            hole, around = holes[hole_side][touching], labels[object_side][touching]
            fresh = np.zeros(count, dtype=np.int32)
            np.maximum.at(fresh, hole, around)
            least = np.full(count, np.iinfo(np.int32).max, dtype=np.int32)
            np.minimum.at(least, hole, around)
            seen = fresh > 0
            mixed |= seen & ((least != fresh) | ((owner > 0) & (owner != fresh)))
            owner = np.where(seen, fresh, owner)
    x, y = statistics[:, cv2.CC_STAT_LEFT], statistics[:, cv2.CC_STAT_TOP]
    outside = (x == 0) | (y == 0)
    outside |= x + statistics[:, cv2.CC_STAT_WIDTH] == labels.shape[1]
    outside |= y + statistics[:, cv2.CC_STAT_HEIGHT] == labels.shape[0]
    owner[mixed | outside | (statistics[:, cv2.CC_STAT_AREA] > largest)] = 0
    return np.where((labels == 0) & valid, owner[holes], labels).astype(np.int32)
