"""Class-agnostic objects of one RGB-D frame: what stands on the support surfaces, cut into patches, put together."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.cuts import CutSettings, cut_patches
from scenewright.stages.segment.backends.objects.grouping import PairScorer, by_rules, group_patches
from scenewright.stages.segment.backends.objects.groups import Groups
from scenewright.stages.segment.backends.objects.patches import PatchFrame, PatchSettings, find_patches
from scenewright.stages.segment.backends.objects.regions import lab_image, measure_regions
from scenewright.stages.segment.backends.objects.rules import RULES, START, rule_table
from scenewright.stages.segment.backends.objects.support import SupportSettings
from scenewright.stages.segment.geometric import pixels_at, relabel

UP_WITHOUT_SURFACE = np.array([0.0, -1.0, 0.0])
"""Direction upwards in the camera frame where no support surface is seen: the camera is taken to be upright."""
BY_SET_RULES = by_rules(rule_table(RULES, START))
"""The scorer that needs no training."""


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


@dataclass(frozen=True)
class Pieces:
    """Patches of one frame, cut so that none lies on two objects."""

    patches: PatchFrame
    labels: np.ndarray
    """(h, w) int32 pieces of the window, 0 none."""
    groups: Groups
    """Every piece a group of its own; to be used once."""


def cut_pieces(color: np.ndarray, depth: np.ndarray, camera: Camera, settings: ObjectSettings) -> Pieces:
    """Return the pieces of a frame that are to be joined. Arguments and errors: see `segment_objects`."""
    if depth.shape != (camera.height, camera.width) or color.shape != (*depth.shape, 3):
        raise ValueError(f"color {color.shape} and depth {depth.shape} do not match {camera.height} x {camera.width}")
    patches = find_patches(depth, camera, settings.patches, settings.support)
    up = patches.supports[0].normal if patches.supports else UP_WITHOUT_SURFACE
    lab = lab_image(color, patches.window)
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
    return Pieces(patches, pieces, Groups(regions, pieces, patches.inverse))


def segment_objects(
    color: np.ndarray,
    depth: np.ndarray,
    camera: Camera,
    scorer: PairScorer = BY_SET_RULES,
    settings: ObjectSettings | None = None,
) -> ObjectFrame:
    """Return the objects of a frame: RGB (H, W, 3) uint8 and z-depth (H, W) [m], 0 invalid, in the same pixels.

    `scorer` says which patches are one object. Raises ValueError when the shapes do not match the camera.
    """
    settings = settings or ObjectSettings()
    cut = cut_pieces(color, depth, camera, settings)
    patches = cut.patches
    labels = group_patches(cut.groups, scorer, settings.threshold).astype(np.int32)[cut.labels]
    labels = _holes_closed(labels, depth[patches.window] > 0, pixels_at(settings.largest_hole, depth.shape))
    large = np.bincount(labels.ravel()) >= pixels_at(settings.minimum_pixels, depth.shape)
    large[0] = False
    result = np.zeros(depth.shape, dtype=np.int32)
    result[patches.window] = relabel(np.where(large, np.arange(len(large)), 0).astype(np.int32)[labels])
    return ObjectFrame(result, patches)


def _holes_closed(labels: np.ndarray, valid: np.ndarray, largest: int) -> np.ndarray:
    """Give pixels that one object surrounds to it: (H, W) int32 labels, where `valid`, holes up to `largest` pixels."""
    count, holes, statistics, _ = cv2.connectedComponentsWithStats((labels == 0).view(np.uint8), connectivity=4)
    owner = _surrounding_labels(labels, holes, count)
    x, y = statistics[:, cv2.CC_STAT_LEFT], statistics[:, cv2.CC_STAT_TOP]
    outside = (x == 0) | (y == 0)
    outside |= x + statistics[:, cv2.CC_STAT_WIDTH] == labels.shape[1]
    outside |= y + statistics[:, cv2.CC_STAT_HEIGHT] == labels.shape[0]
    owner[outside | (owner < 0) | (statistics[:, cv2.CC_STAT_AREA] > largest)] = 0
    return np.where((labels == 0) & valid, owner[holes], labels)


@compiled
def _surrounding_labels(labels: np.ndarray, holes: np.ndarray, count: int) -> np.ndarray:
    """The one label that every hole 0..count-1 of `holes` (H, W) touches: 0 when none, -1 when several."""
    sole = np.zeros(count, dtype=np.int32)
    height, width = labels.shape
    for v in range(height):
        for u in range(width):
            for side in range(2):
                row, column = v + side, u + 1 - side
                if row >= height or column >= width:
                    continue
                a, b = labels[v, u], labels[row, column]
                if (a == 0) == (b == 0):
                    continue
                hole = holes[v, u] if a == 0 else holes[row, column]
                if sole[hole] == 0:
                    sole[hole] = a + b
                elif sole[hole] != a + b:
                    sole[hole] = -1
    return sole
