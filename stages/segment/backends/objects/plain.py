"""The plain pipeline to compare with: convex segments of the depth, the table taken away, one merging pass.

No colour, no look at whole objects, no cut: segments that touch without a depth jump and not along a concave crease
are one object (the local convexity of Stein et al. 2014, judged once for every pair), small ones join the neighbour
with the longest common border.
"""

from __future__ import annotations

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.segment.backends.objects.patches import foreground_of
from scenewright.stages.segment.backends.objects.regions import measure_regions
from scenewright.stages.segment.backends.objects.support import SupportSettings, find_supports
from scenewright.stages.segment.geometric import pixels_at, relabel, segment_depth

ON_SURFACE = 0.6
"""A segment with more than this share of its pixels on a support surface is part of it."""
CONNECTED, CONCAVE = 0.5, 0.35
"""Least share of a border without a depth jump, and most of it on a concave crease, for a merge."""
SMALL, MINIMUM = 600, 250
"""Segments and objects under so many pixels (at 640x480) join a neighbour, or are dropped."""
JUMP = 0.01
"""Depth step between neighbouring pixels that parts patches, as a share of the depth; by eye."""


def segment_plain(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Return objects (H, W) int32 1..n, 0 none, of a z-depth image (H, W) [m], 0 invalid."""
    segments = segment_depth(depth, camera)
    z = segments.points[..., 2]
    inverse = np.where(z > 0, 1 / np.where(z > 0, z, 1), 0).astype(np.float32)
    settings = SupportSettings()
    supports = find_supports(z, camera, settings)
    foreground, height = foreground_of(inverse, camera, supports, settings)
    total = np.bincount(segments.labels.ravel())
    over = np.bincount(segments.labels.ravel(), weights=foreground.ravel(), minlength=len(total))
    stands = over > (1 - ON_SURFACE) * total
    stands[0] = False
    labels = relabel(np.where(stands[segments.labels] & foreground, segments.labels, 0).astype(np.int32))
    count = int(labels.max(initial=0))
    up = supports[0].normal if supports else np.array([0.0, -1.0, 0.0])
    color = np.zeros((*depth.shape, 3), dtype=np.float32)
    regions = measure_regions(
        labels, np.arange(count + 1), segments.points, segments.normals, inverse, height, color, up, jump=JUMP
    )
    merged = _merge_segments(regions.borders, regions.sums[:, 0], pixels_at(SMALL, depth.shape))[labels]
    large = np.bincount(merged.ravel()) >= pixels_at(MINIMUM, depth.shape)
    large[0] = False
    return relabel(np.where(large[merged], merged, 0).astype(np.int32))


def _merge_segments(borders: np.ndarray, pixels: np.ndarray, small: int) -> np.ndarray:
    """Return (N + 1,) int32 the object of every segment from the border sums of regions.py, one pass."""
    count = len(pixels) - 1
    root = np.arange(count + 1, dtype=np.int32)
    length = borders[..., 0]
    sampled = np.maximum(borders[..., 3], 1)
    same = (length > 0) & (borders[..., 1] > CONNECTED * length) & (borders[..., 5] < CONCAVE * sampled)
    for a in range(1, count + 1):
        partners = [b for b in range(a + 1, count + 1) if same[a, b]]
        if 0 < pixels[a] < small and length[a].any():
            partners.append(int(length[a].argmax()))
        for b in partners:
            first, second = sorted((root[a], root[b]))
            root[root == second] = first
    return root
